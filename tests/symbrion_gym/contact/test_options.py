"""Options of contact geometry, and everything that tunes it."""

import pytest

from symbrion_gym._src.contact.options import ContactOptions
from symbrion_gym._src.errors import ArenaError


@pytest.mark.parametrize(
    "changes", [{"kind": "jelly"}, {"accuracy": 0.0}, {"time_limit": float("inf")}, {"max_pieces": 0}]
)
def test_options_out_of_range_are_refused(changes):
    with pytest.raises(ArenaError, match=next(iter(changes))):
        ContactOptions(**changes)
