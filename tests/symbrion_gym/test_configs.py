"""Configurations refuse numbers that cannot be, with the field and its value."""

import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.errors import OptionError, SurveyError
from symbrion_gym._src.robot.scout_constants import SensorNoise


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        (SensorNoise, {"laser": np.nan}),
        (sg.ScoutConfig, {"laser_beams": 0}),
        (sg.LaserScanner, {"noise": None}),
    ],
)
def test_impossible_numbers_are_refused(kind, change):
    name, value = next(iter(change.items()))
    with pytest.raises(sg.SymbrionGymError, match=name) as caught:
        kind(**change)
    assert isinstance(caught.value, ValueError)
    assert repr(value) in str(caught.value) or name == "lanes"


def test_errors_have_one_base():
    for error in (sg.ArenaError, sg.OrganismError, OptionError, SurveyError):
        assert issubclass(error, sg.SymbrionGymError)
        assert issubclass(error, ValueError)
    with pytest.raises(sg.SymbrionGymError, match="no 'wings'"):
        sg.OrganismEnv(wings=2)
