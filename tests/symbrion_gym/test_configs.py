"""Configurations refuse numbers that cannot be, with the field and its value."""

import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.errors import OptionError, SurveyError
from symbrion_gym._src.robot.scout_constants import SensorNoise
from symbrion_gym._src.tasks.audit_checks import AuditLimits
from symbrion_gym._src.tasks.features.gap import GapSearch
from symbrion_gym._src.tasks.route import RouteMargins, SuccessCriteria


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        (SuccessCriteria, {"hold_time": -0.1}),
        (SuccessCriteria, {"upright": 1.5}),
        (SuccessCriteria, {"ground_band": (0.1, 0.1)}),
        (SuccessCriteria, {"max_rate": 0.0}),
        (RouteMargins, {"before_pit": -0.1}),
        (GapSearch, {"step": 0.0}),
        (GapSearch, {"wall_steps": 0}),
        (GapSearch, {"agreement": 0.0}),
        (SensorNoise, {"laser": np.nan}),
        (AuditLimits, {"max_speed": "fast"}),
        (AuditLimits, {"rolled_over": -2.0}),
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
