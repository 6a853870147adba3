"""Quality of an arena as numbers: what is measured is kept, what is not is absent, older files stay readable."""

import numpy as np
import pytest

from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

FULL = ArenaQuality(0.001, 0.002, 0.003, 7, 0.0005, 0.01, 1.5, 0.001, 0.002, 0.004, 0.78, 0.79, 0.004, 0.19)


def test_fields_return_from_json():
    assert ArenaQuality.from_dict(FULL.as_dict()) == FULL


def test_what_was_not_measured_is_absent():
    quality = ArenaQuality(0.0, 0.0, 0.0, 1, free_space=0.0, protrusion_max=np.inf)
    assert quality.as_dict()["free_space"] == 0.0
    assert quality.as_dict()["protrusion_max"] is None
    assert "beams_contact" not in quality.as_dict()
    assert ArenaQuality.from_dict(quality.as_dict()) == quality


@pytest.mark.parametrize(
    ("name", "value"),
    [("mean", -1.0), ("max", np.nan), ("num_pieces", -1), ("uncovered", 1.1), ("protrusion_mean", -0.1),
     ("protrusion_p95", np.nan), ("beams_contact", 1.1), ("beams_surface", -0.1), ("free_space", 2.0),
     ("dropped", np.nan)],
)  # fmt: skip
def test_impossible_fields_are_refused(name, value):
    fields = {"mean": 0.0, "p95": 0.0, "max": 0.0, "num_pieces": 1} | {name: value}
    with pytest.raises(ArenaError, match=name):
        ArenaQuality(**fields)


def test_unknown_fields_are_refused():
    with pytest.raises(ArenaError, match="beams_missed"):
        ArenaQuality.from_dict(FULL.as_dict() | {"beams_missed": 0.1})
