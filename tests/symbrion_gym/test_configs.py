"""Configurations refuse numbers that cannot be, with the field and its value."""

import numpy as np
import pytest

import symbrion_gym as sg


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        (sg.SuccessCriteria, {"hold_time": -0.1}),
        (sg.SuccessCriteria, {"upright": 1.5}),
        (sg.SuccessCriteria, {"ground_band": (0.1, 0.1)}),
        (sg.SuccessCriteria, {"max_rate": 0.0}),
        (sg.RouteMargins, {"before_pit": -0.1}),
        (sg.GapSearch, {"step": 0.0}),
        (sg.GapSearch, {"wall_steps": 0}),
        (sg.GapSearch, {"agreement": 0.0}),
        (sg.SensorNoise, {"laser": np.nan}),
        (sg.SurveyRoom, {"height": 0.0}),
        (sg.SurveyRoom, {"pilaster_width": (0.5, 0.2)}),
        (sg.AuditLimits, {"max_speed": "fast"}),
        (sg.AuditLimits, {"rolled_over": -2.0}),
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
    for error in (sg.ArenaError, sg.OrganismError, sg.OptionError, sg.SurveyError):
        assert issubclass(error, sg.SymbrionGymError)
        assert issubclass(error, ValueError)
    with pytest.raises(sg.SymbrionGymError, match="no 'wings'"):
        sg.SnakePitEnv(wings=2)
