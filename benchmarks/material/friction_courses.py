"""Courses with friction patches drawn at random, and what an estimate of their friction is worth."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from reconstruction._src.slip.drags import find_friction
from reconstruction._src.slip.patches import FrictionEstimate, find_friction_patches
from reconstruction._src.slip.readings import SlipReadings
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.friction_map import FrictionMap
from symbrion_gym._src.arenas.ground_friction import make_friction_map
from symbrion_gym._src.sensing.friction_drive import drive_lanes
from symbrion_gym._src.sensing.friction_robot import FrictionRobot

LEAST_WAY = 1.0
"""Patches on which the robot drove less are not judged [m]."""
_BIN = 0.05
"""Parts of a lane that count as driven, each once a run [m]."""
_BORDER = 0.06
"""Places closer to the border of a patch are not its own [m]: the module stands on both sides."""
LANES = FrictionRobot(spacing=0.5)


class PatchRow(NamedTuple):
    """What became of one true patch.

    Attributes:
        course: seed of the course.
        truth: its friction.
        way: how far the robot drove on it [m].
        estimate: of the map, where most of its driven places are.
        half_width: of the interval.
    """

    course: int
    truth: float
    way: float
    estimate: float
    half_width: float

    @property
    def error(self) -> float:
        """Estimate less truth."""
        return self.estimate - self.truth

    @property
    def is_covered(self) -> bool:
        """Whether the interval holds the truth."""
        return abs(self.error) <= self.half_width


def draw_course(seed: int) -> Course:
    """Draw a course: sizes, a friction, and patches of 0.3 to 0.9 across all or half of its width."""
    rng = np.random.default_rng([20, seed])
    sizes: dict[str, Any] = {
        "height": rng.uniform(0.15, 0.27),
        "ramp": rng.uniform(0.9, 1.2),
        "plateau": rng.uniform(0.45, 0.7),
    }
    course = Course(pit=rng.uniform(0.3, 0.45), friction=round(rng.uniform(0.3, 0.9), 3), **sizes)
    patches, x = [], -course.length / 2 + rng.uniform(0.1, 0.4)
    while x < course.length / 2 - 0.6:
        end = min(x + rng.uniform(0.5, 1.1), course.length / 2)
        friction = round(rng.uniform(0.3, 0.9), 3)
        across = [(), (-1.0, 0.0), (0.0, 1.0)][rng.integers(3)]
        patches.append((x, end, *across, friction))
        x = end + rng.uniform(0.5, 1.2)
    return replace(course, friction_patches=tuple(patches))


def feel_course(
    course: Course, seed: int, robot: FrictionRobot = LANES
) -> tuple[SlipReadings, FrictionEstimate]:
    """Drive over a course and return what was read and what it says."""
    readings = drive_lanes(Arena.from_course(course), robot, np.random.default_rng([seed, 1]))
    estimate = find_friction_patches(find_friction(readings))
    assert estimate is not None
    return readings, estimate


def judge_patches(
    course: Course, seed: int, readings: SlipReadings, felt: FrictionEstimate
) -> list[PatchRow]:
    """Return a row for every true patch, and one for the ground outside of all, that was driven far enough."""
    truth, found = course.friction_map or FrictionMap(), make_friction_map(felt)
    patches = [(course.friction, -1), *((patch.friction, i) for i, patch in enumerate(truth.patches))]
    estimates = [(patch.friction, patch.half_width) for patch in found.patches]
    estimates.append((felt.patches[0].friction, felt.patches[0].half_width))
    own, places = _find_own(truth, readings), readings.positions
    rows = []
    for friction, number in patches:
        is_here = own == number
        bins = np.unique(np.c_[readings.runs[is_here], np.floor(places[is_here, 0] / _BIN)], axis=0)
        way = len(bins) * _BIN
        if way >= LEAST_WAY:
            numbers = found.find_patches(places[is_here])
            most = int(np.bincount(numbers + 1).argmax()) - 1
            rows.append(PatchRow(seed, friction, round(way, 2), *estimates[most]))
    return rows


def judge_places(course: Course, readings: SlipReadings, felt: FrictionEstimate) -> dict[str, Any]:
    """Return how often the map is right where the robot drove, away from borders."""
    truth, found = course.friction_map or FrictionMap(), make_friction_map(felt)
    places = readings.positions[_find_own(truth, readings) > -2]
    error = found.find_friction(places, felt.patches[0].friction) - truth.find_friction(
        places, course.friction
    )
    return {"within": float(np.mean(np.abs(error) <= 0.05)), "p95": float(np.percentile(np.abs(error), 95))}


def _find_own(truth: FrictionMap, readings: SlipReadings) -> np.ndarray:
    """Return the true patch of every place, -1 outside of all, -2 at the borders."""
    places = readings.positions
    middle = truth.find_patches(places)
    for shift in ((_BORDER, 0.0, 0.0), (-_BORDER, 0.0, 0.0), (0.0, _BORDER, 0.0), (0.0, -_BORDER, 0.0)):
        middle = np.where(truth.find_patches(places + shift) == middle, middle, -2)
    return middle
