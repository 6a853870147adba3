"""No faster than its tracks, on the whole path: both judges, on motions made by hand."""

import numpy as np
import pytest

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.tasks.audit import Motion, find_bad_pace, find_unsteady_end
from symbrion_gym._src.tasks.goals import find_honest, find_honest_along
from symbrion_gym._src.tasks.state import TaskState, Views
from symbrion_gym._src.tasks.watch import Watch

TRACK_SPEED, DT, COUNT = 0.1, 0.02, 3
TICKS = 50
UPRIGHT = np.tile(np.eye(3).ravel(), (COUNT, 1))


@pytest.fixture(scope="module")
def world() -> World:
    return World(EnvironmentConfig(modules=COUNT, pit=0.2))


def make_path(ahead: float, hang: float = 0.0, rise: float = 0.0, ends_ahead: bool = False) -> np.ndarray:
    """Return centers `[T, n, 3]` of a body that is ahead of its tracks in the second fifth of the time.

    Then its last module is lifted, and the others hang below it; their mean height is that of the last less `hang`.
    """
    tick = np.arange(TICKS)
    start = np.array([[-0.5 - 0.1254 * index, 0.0, 0.3] for index in range(COUNT)])
    is_ahead = (tick >= 10) & ((tick < 20) | ends_ahead)
    shift = np.zeros((TICKS, COUNT, 3))
    shift[:, :, 0] = (TRACK_SPEED * DT * tick + ahead * is_ahead)[:, None]
    shift[is_ahead, :, 2] = rise
    shift[is_ahead, :-1, 2] -= hang * COUNT / (COUNT - 1)
    return start + shift


def is_honest(world: World, *paths: np.ndarray) -> np.ndarray:
    """Return which bodies the success check finds honest at the end of their paths."""
    position, count = np.array([path[0] for path in paths]), len(paths)
    rotation = np.repeat(UPRIGHT[None], count, axis=0)
    state = TaskState(world.scene, world.task.goal, count, DT, np.zeros((count, COUNT - 1)))
    state.bind(Views(position, rotation, np.zeros((count, 8)), *np.zeros((2, count, COUNT - 1))))
    watch = Watch(world.task, state)
    state.begin([*range(count)], [TRACK_SPEED] * count)
    watch.begin(range(count))
    for tick in range(1, TICKS):
        position[:] = [path[tick] for path in paths]
        state.advance(None, is_sound=True)
        watch.look(None, is_sound=True)
    np.testing.assert_array_equal(find_honest(state), find_honest_along(state))
    return find_honest(state)


def is_clean(path: np.ndarray) -> bool:
    """Return whether the audit finds nothing."""
    rotations = np.broadcast_to(np.eye(3), (*path.shape[:2], 3, 3))
    return not find_bad_pace(Motion(np.arange(len(path)) * DT, path, rotations), TRACK_SPEED)


@pytest.mark.parametrize(
    ("expected", "motion"),
    [
        (True, {"ahead": 0.0}),
        (True, {"ahead": 0.04}),  # it tips forwards
        (False, {"ahead": 0.08}),  # it is thrown
        (False, {"ahead": 0.08, "rise": 0.05}),
        (False, {"ahead": 0.08, "rise": -0.05}),
        (True, {"ahead": 0.08, "hang": 0.05}),  # it is pulled
        (False, {"ahead": 0.14, "hang": 0.05}),
        (False, {"ahead": 0.08, "hang": 0.05, "ends_ahead": True}),
    ],
)
def test_audit_and_success_check_agree_on_who_was_faster_than_its_tracks(world, expected, motion):
    path = make_path(**motion)
    assert bool(is_honest(world, path)[0]) is expected
    assert is_clean(path) is expected


def test_a_lead_of_another_body_excuses_no_earlier_one(world):
    thrown, later = make_path(0.08), make_path(0.0)
    later[25:35] = make_path(0.08, 0.05)[10:20] + np.array([15 * TRACK_SPEED * DT, 0.0, 0.0])
    np.testing.assert_array_equal(is_honest(world, thrown, later), [False, True])
    assert is_clean(later)


def test_a_new_episode_forgets_it(world):
    state = TaskState(world.scene, world.task.goal, 1, DT, np.zeros((1, COUNT - 1)))
    position = make_path(0.0)[:1]
    state.bind(Views(position, UPRIGHT[None], np.zeros((1, 8)), *np.zeros((2, 1, COUNT - 1))))
    state.begin([0], [TRACK_SPEED])
    position[..., 0] += 0.2
    state.advance(None, is_sound=True)
    state.note_lead()
    assert state.was_ahead[0]
    assert state.way[0] - state.start_way[0] == pytest.approx(0.2)
    state.begin([0], [TRACK_SPEED])
    assert not state.was_ahead[0]
    state.advance(None, is_sound=True)
    assert state.way[0] == state.start_way[0]
    assert state.compute_pace()[0] == state.start_way[0] + TRACK_SPEED * DT + state.criteria.speed_slack


@pytest.mark.parametrize("beyond", [np.nan, -0.25], ids=["nothing", "a gap"])
@pytest.mark.parametrize(("x", "faults"), [(0.96, 0), (1.01, 1)], ids=["over its rim", "beyond it"])
def test_a_module_on_a_rim_stands_on_the_ground_while_its_center_is_over_it(x, faults, beyond):
    """Ground ends at x = 1; the corners of a module reach 5 cm from its center, and those ahead are lowest."""

    def height(x, y, z):
        return np.where(x < 1.0, 0.0, beyond)

    time = np.arange(TICKS) * DT
    tilt = np.array([[np.cos(0.1), 0.0, np.sin(0.1)], [0.0, 1.0, 0.0], [-np.sin(0.1), 0.0, np.cos(0.1)]])
    centers = np.tile([x, 0.0, 0.055], (TICKS, 1, 1))
    motion = Motion(time, centers, np.tile(tilt, (TICKS, 1, 1, 1)))
    found = find_unsteady_end(motion, height)
    assert len(found) == faults
    lifted = motion._replace(centers=centers + np.array([0.0, 0.0, 0.06]))
    assert find_unsteady_end(lifted, height)
