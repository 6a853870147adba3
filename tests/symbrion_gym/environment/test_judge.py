"""The strict test of success: bodies laid beyond the pit by hand, with one thing wrong at a time."""

import numpy as np
import pytest

from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.environment.judge import Judge
from symbrion_gym.environment.world import Physics, World

FAR_EDGE = 0.1
"""Of a pit 0.2 m wide [m]."""
PLATEAU = 0.25
"""Its height [m]."""
HALF = 0.0525
"""Half the height and width of a module [m]: its centre above the ground, whichever of four sides it lies on."""


@pytest.fixture(scope="module")
def judge() -> Judge:
    return Judge(World(SnakePitConfig(modules=3, pit=2 * FAR_EDGE)))


def turn(axis: str, angle_deg: float) -> np.ndarray:
    """Return the rotation matrix about an axis of the world."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    if axis == "y":
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def lay(tail: float, *, height: float = PLATEAU + HALF, rotation: np.ndarray | None = None) -> Physics:
    """Return a straight body, its last module with its centre `tail` beyond the edge, raised and turned [m]."""
    x = FAR_EDGE + tail + 0.1254 * np.arange(3)[::-1]
    position = np.column_stack([x, np.zeros(3), np.full(3, PLATEAU + HALF)])
    rotations = np.tile(np.eye(3), (3, 1, 1))
    position[2, 2] = height
    rotations[2] = np.eye(3) if rotation is None else rotation
    none = np.zeros((1, 0))
    return Physics(none, none, position[None], rotations.reshape(1, 3, 9), none, none)


def test_a_body_that_stands_beyond_the_pit_has_arrived(judge: Judge):
    assert judge.is_standing(lay(tail=0.06), 0)
    assert judge.is_standing(lay(tail=0.3), 0)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("angle", "stands"), [(40, True), (-40, True), (90, False), (-90, False), (75, False)]
)
def test_a_module_on_its_side_or_on_its_end_is_no_success(judge: Judge, axis, angle, stands):
    assert judge.is_standing(lay(tail=0.12, rotation=turn(axis, angle)), 0) is stands


@pytest.mark.parametrize("above", [HALF - 0.02, HALF + 0.01])
def test_a_module_may_sink_in_or_ride_up_a_little(judge: Judge, above):
    assert judge.is_standing(lay(tail=0.12, height=PLATEAU + above), 0)


@pytest.mark.parametrize("above", [HALF + 0.2, HALF + 0.105, HALF + 0.04, 0.0, -0.05])
def test_a_module_stacked_on_another_or_in_the_ground_is_no_success(judge: Judge, above):
    assert not judge.is_standing(lay(tail=0.12, height=PLATEAU + above), 0)


@pytest.mark.parametrize(
    ("tail", "yaw", "stands"),
    [
        (0.01, 0, False),
        (0.04, 0, False),
        (0.06, 0, True),
        (0.06, 45, False),
        (0.06, -45, False),
        (0.08, 45, True),
    ],
)
def test_a_corner_that_is_not_yet_beyond_the_edge_is_no_success(judge: Judge, tail, yaw, stands):
    """What must be beyond is a cube of 0.1 m in the module, so a turned one must have gone farther."""
    assert judge.is_standing(lay(tail, rotation=turn("z", yaw)), 0) is stands


def test_one_module_left_behind_is_no_success(judge: Judge):
    physics = lay(tail=0.12)
    physics.position[0, 2, 0] = -FAR_EDGE - 0.1
    assert not judge.is_standing(physics, 0)
