"""Options of contact geometry, and everything that tunes it."""

from dataclasses import fields, is_dataclass

import pytest

from symbrion_gym._src.contact.options import ContactConfig, ContactOptions
from symbrion_gym._src.contact.primitives import SlabPassConfig
from symbrion_gym._src.errors import ArenaError


@pytest.mark.parametrize(
    "changes", [{"kind": "jelly"}, {"accuracy": 0.0}, {"time_limit": float("inf")}, {"max_pieces": 0}]
)
def test_options_out_of_range_are_refused(changes):
    with pytest.raises(ArenaError, match=next(iter(changes))):
        ContactOptions(**changes)


def test_tuning_is_noted_where_it_is_not_the_default():
    assert "config" not in ContactOptions().as_dict()
    tuned = ContactOptions(config=ContactConfig(slab_pass=SlabPassConfig(max_slabs=3)))
    assert tuned.as_dict()["config"]["slab_pass"]["max_slabs"] == 3


def test_every_number_that_tunes_is_documented():
    for field in fields(ContactConfig):
        config = getattr(ContactConfig(), field.name)
        if not is_dataclass(config):
            continue
        missing = [
            each.name for each in fields(config) if f"{each.name}: " not in (type(config).__doc__ or "")
        ]
        assert not missing, f"{type(config).__name__} says nothing of {missing}"
