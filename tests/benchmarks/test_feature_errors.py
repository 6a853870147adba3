"""The judge of found features, with errors known by hand."""

import dataclasses

import numpy as np
import pytest

from benchmarks.features import _MOVE, judge, summarize
from benchmarks.material.bare_surfaces import make_bare
from benchmarks.material.survey_noise import find_priors, make_robot
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.sensing.survey_robot import SurveyRobot
from symbrion_gym._src.tasks.features.gap import find_gap


@pytest.mark.parametrize("degrees", [0.0, 20.0, 137.0])
def test_the_gap_of_the_truth_has_no_error(degrees):
    yaw = np.radians(degrees)
    gap = find_gap(make_bare(Course(pit=0.3).surface(), yaw, _MOVE))
    errors = judge(gap, 0.3, yaw)
    assert errors.pop("confidence") == 1.0
    assert errors.pop("way_width_mm") == pytest.approx(0.0, abs=21)
    assert max(map(abs, errors.values())) < 6.0  # the middle of a turned way is a whole centimeter
    moved = dataclasses.replace(gap, near=gap.near + 0.004, far=gap.far + 0.004)
    assert judge(moved, 0.3, yaw)["near_mm"] - errors["near_mm"] == pytest.approx(4.0)
    rows = [{"is_found": True, **judge(one, 0.3, yaw)} for one in (gap, moved)]
    assert summarize([*rows, {"is_found": False}])["found"] == 2


def test_noise_is_scaled_and_stated():
    robot, priors = make_robot(2.0), find_priors(2.0)
    assert robot.shake == 2 * SurveyRobot().shake
    assert (priors["stated"].shake, priors["stated"].slip) == (robot.shake, robot.step_noise)
    assert priors["stated for the default robot"].slip == SurveyRobot().step_noise
    assert priors["estimated"].slip is None
