"""The strict test of success: bodies laid beyond the pit by hand, with one thing wrong at a time."""

from copy import copy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.tasks.goals import find_across, find_honest_along, find_standing
from symbrion_gym._src.tasks.route import SuccessCriteria
from symbrion_gym._src.tasks.state import Scene, TaskState, Views
from symbrion_gym._src.tasks.terms import FellOff, RolledOver, Stuck, TouchedPit
from symbrion_gym._src.tasks.watch import Watch

FAR_EDGE = 0.1
"""Of a pit 0.2 m wide [m]."""
PLATEAU = 0.25
"""Its height [m]."""
HALF = 0.0525
"""Half the height and width of a module [m]: its center above the ground, whichever of four sides it lies on."""


@cache
def find_world(modules: int = 3, **options: Any) -> World:
    """Return a world that is compiled once; what judges in it is made for each test."""
    return World(EnvironmentConfig(modules=modules, **options))


@pytest.fixture
def check() -> World:
    return find_world(pit=2 * FAR_EDGE)


def find_state(
    world: World, position: np.ndarray, rotation: np.ndarray | None = None, **parts: np.ndarray
) -> TaskState:
    """Return the state of one simulation, at rest and upright but for what is given."""
    position = np.asarray(position, float)
    count = len(position)
    rotation = np.tile(np.eye(3).ravel(), (count, 1)) if rotation is None else rotation
    still = {"qvel": np.zeros(8), "hinge_rate": np.zeros(count - 1), "torque": np.zeros(count - 1)} | parts
    state = TaskState(world.scene, world.task.goal, 1, world.config.dt, np.zeros((1, count - 1)))
    state.bind(
        Views(
            position[None], rotation[None], *(still[name][None] for name in ("qvel", "hinge_rate", "torque"))
        )
    )
    state.begin([0], [0.1])
    state.advance(None, is_sound=False)
    return state


def stands(world: World, position: np.ndarray, rotation: np.ndarray) -> bool:
    """Return whether every module is upright, at ground height and wholly across."""
    state = find_state(world, position, rotation)
    return bool(find_across(state)[0] and find_standing(state, np.array([0]))[0])


def touches(world: World, position: np.ndarray, rotation: np.ndarray) -> bool:
    """Return whether a module touches the floor of the pit."""
    function = next(term.function for term in world.task.terminations if term.name == "touched_pit")
    return bool(function(find_state(world, position, rotation))[0])


Laid = tuple[np.ndarray, np.ndarray]
"""Positions of the modules `[n, 3]` [m] and their rotation matrices `[n, 9]`."""


def turn(axis: str, angle_deg: float) -> np.ndarray:
    """Return the rotation matrix about an axis of the world."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    if axis == "y":
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def lay(tail: float, *, height: float = PLATEAU + HALF, rotation: np.ndarray | None = None) -> Laid:
    """Return a straight body, its last module with its center `tail` beyond the edge, raised and turned [m]."""
    x = FAR_EDGE + tail + 0.1254 * np.arange(3)[::-1]
    position = np.column_stack([x, np.zeros(3), np.full(3, PLATEAU + HALF)])
    rotations = np.tile(np.eye(3), (3, 1, 1))
    position[2, 2] = height
    rotations[2] = np.eye(3) if rotation is None else rotation
    return position, rotations.reshape(3, 9)


def test_a_body_that_stands_beyond_the_pit_has_arrived(check: World):
    assert stands(check, *lay(tail=0.06))
    assert stands(check, *lay(tail=0.3))


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("angle", "expected"), [(40, True), (-40, True), (90, False), (-90, False), (75, False)]
)
def test_a_module_on_its_side_or_on_its_end_is_no_success(check: World, axis, angle, expected):
    assert stands(check, *lay(tail=0.12, rotation=turn(axis, angle))) is expected


@pytest.mark.parametrize(
    ("above", "expected"),
    [(-0.02, True), (0.01, True), (0.2, False), (0.105, False), (0.04, False), (-HALF, False)],
)
def test_a_module_may_sink_in_or_ride_up_a_little_but_stands_on_no_other(check: World, above, expected):
    assert stands(check, *lay(tail=0.12, height=PLATEAU + HALF + above)) is expected


@pytest.mark.parametrize(
    ("tail", "yaw", "expected"),
    [(0.04, 0, False), (0.06, 0, True), (0.06, 45, False), (0.06, -45, False), (0.08, 45, True)],
)
def test_a_corner_that_is_not_yet_beyond_the_edge_is_no_success(check: World, tail, yaw, expected):
    """What must be beyond is a cube of 0.1 m in the module, so a turned one must have gone farther."""
    assert stands(check, *lay(tail, rotation=turn("z", yaw))) is expected


def test_what_is_measured_of_a_body(check: World):
    places = np.array([[0.3, 0.02, 0.31], [0.0, -0.07, 0.29], [-0.24, 0.04, 0.33]])
    rotation = np.tile(np.eye(3).ravel(), (3, 1))
    rotation[:, 8] = 0.9, -0.2, 0.7
    state = find_state(
        check, places, rotation, torque=np.array([2.0, -3.0]), hinge_rate=np.array([-0.5, -0.1])
    )
    assert (state.along[0, 0], state.compute_mean_along()[0]) == pytest.approx((0.3, 0.02))
    assert (-state.least_right[0], state.least_left[0], state.rear[0]) == pytest.approx((0.04, -0.07, -0.24))
    assert (state.lowest[0], state.least_up[0], state.power[0]) == pytest.approx((0.29, -0.2, 1.3))
    assert state.is_sound[0]


def test_no_module_makes_progress_beyond_the_finish(check: World):
    finish = FAR_EDGE + 0.1254 / 2
    assert check.route.finish == pytest.approx(finish)
    some = find_state(check, [[finish + 0.2, 0, 0.3], [finish + 0.1, 0, 0.3], [finish - 0.1, 0, 0.3]])
    assert some.progress[0] == pytest.approx(finish - 0.1 / 3)
    assert some.compute_mean_along()[0] == pytest.approx(finish + 0.2 / 3)
    whole = find_state(check, [[finish + 0.2, 0, 0.3], [finish + 0.1, 0, 0.3], [finish + 0.01, 0, 0.3]])
    assert whole.progress[0] == pytest.approx(finish)


@pytest.mark.parametrize(("tail", "expected"), [(0.07, True), (0.06, False)])
def test_a_body_has_arrived_with_every_center_beyond_the_finish(check: World, tail, expected):
    assert check.task.goal.has_arrived(find_state(check, *lay(tail=tail)))[0] == expected


def test_a_body_that_was_faster_than_its_tracks_has_not_arrived(check: World):
    state = find_state(check, *lay(tail=0.12))
    state.start_mean[:] -= 0.049
    assert find_honest_along(state)[0]
    state.start_mean[:] -= 0.01
    assert not find_honest_along(state)[0]
    assert not check.task.goal.has_arrived(state)[0]
    state.tick[:] = 50
    assert find_honest_along(state)[0]


def test_a_robot_takes_itself_to_start_as_far_from_the_middle_of_the_pit_as_its_map_says():
    scene = World(EnvironmentConfig(modules=3, pit=2 * FAR_EDGE)).scene
    assert scene.start_on_map == scene.route.start
    there = replace(scene, map_route=replace(scene.map_route, start=-1.0, pit=(0.3, 0.7, 0.0)))
    assert there.start_on_map == pytest.approx(-1.5)
    assert replace(scene, map_route=replace(there.map_route, pit=None)).start_on_map == -1.0


@pytest.mark.parametrize(
    ("rate", "is_sound"),
    [(-49.0, True), (49.9, True), (50.1, False), (-50.1, False), (np.nan, False), (np.inf, False)],
)
def test_numbers_that_are_no_longer_physics_are_seen(check: World, rate, is_sound):
    with np.errstate(all="ignore"):
        state = find_state(
            check, np.full((3, 3), 0.3), qvel=np.r_[np.zeros(7), rate], hinge_rate=np.full(2, np.inf)
        )
    assert state.is_sound[0] == is_sound
    assert state.lowest[0] == (0.3 if is_sound else 0.0)
    assert is_sound or state.power[0] == 0.0


@pytest.mark.parametrize(("frame_skip", "ticks"), [(10, 15), (20, 8), (200, 1)])
def test_a_body_must_stand_for_three_tenths_of_a_second(frame_skip, ticks):
    config = EnvironmentConfig(modules=3, pit=2 * FAR_EDGE, frame_skip=frame_skip, timestep=0.002)
    assert count_ticks(World(config)) == ticks


def test_a_body_that_tips_back_begins_to_stand_again():
    world = World(EnvironmentConfig(modules=3, pit=2 * FAR_EDGE))
    needed, state = count_ticks(world), find_state(world, *lay(tail=0.12))
    watch = Watch(world.task, state)
    watch.begin([0])
    stands = iter([True] * (needed - 1) + [False] + [True] * (needed - 1) + [False])
    watch._has_arrived = lambda state: np.array([next(stands)])
    for _ in range(2 * needed):
        state.advance(None, is_sound=True)
        watch.look(None, is_sound=True)
        assert not watch.flags[0, 0]


def count_ticks(world: World) -> int:
    """Return after how many ticks a body that stands beyond the finish has succeeded."""
    state = find_state(world, *lay(tail=0.12))
    watch = Watch(world.task, state)
    watch.begin([0])
    for ticks in range(1, 100):
        state.advance(None, is_sound=True)
        if watch.look(None, is_sound=True):
            assert watch.flags[0, 0]
            assert watch.terminated[0]
            return ticks
    raise AssertionError("never")


@pytest.mark.parametrize(("heading", "lateral"), [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (np.pi / 2, 0.0)])
def test_places_are_measured_along_and_beside_any_way(check: World, heading, lateral):
    route = replace(check.route, heading=heading, lateral=lateral)
    places = np.array([[0.3, 0.02, 0.31], [0.0, -0.07, 0.29], [0.1, 0.2, 0.3]])
    ahead, left = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    world = copy(check)
    world.scene = Scene(check.arena, check.organism, route, route)
    state = find_state(world, places)
    assert state.along[0] == pytest.approx(places[:, :2] @ ahead)
    assert state.left[0] == pytest.approx(places[:, :2] @ left - lateral)
    assert state.target[0] == pytest.approx(route.finish * ahead + lateral * left)


@pytest.mark.parametrize(
    ("angle", "tail", "yaw", "expected"),
    [
        (45, 0.06, 45, True),
        (45, 0.06, 0, False),
        (45, 0.08, 0, True),
        (45, 0.04, 45, False),
        (37, 0.06, 37, True),
        (37, 0.06, -37, False),
    ],
)
def test_on_a_turned_way_corners_count_along_it(angle, tail, yaw, expected):
    """The edge is half a module's length before the finish; the way goes from (-2.9, -0.6) to the left of x."""
    ahead = turn("z", angle)[:2, 0]
    start = np.array([-2.9, -0.6])
    world = find_world(arena="truth", start=tuple(start), goal=tuple(start + 1.1 * ahead))
    steps = world.route.finish - 0.1254 / 2 + tail + 0.1254 * np.arange(3)[::-1]
    position, rotation = lay(tail=0.12)
    middle = start - (start @ ahead) * ahead
    position[:] = np.column_stack([middle + np.outer(steps, ahead), np.full(3, HALF)])
    rotation[:] = [turn("z", each).ravel() for each in (angle, angle, yaw)]
    assert stands(world, position, rotation) is expected


@pytest.fixture
def bottomless() -> World:
    return find_world(pit=2 * FAR_EDGE, bottomless=True)


def test_a_module_that_touches_the_floor_of_the_pit_is_seen(bottomless: World):
    for height, pitch, x, expected in (
        (HALF + 0.005, 0, 0.0, True),
        (HALF + 0.005, 0, FAR_EDGE - 0.01, True),
        (HALF + 0.005, 0, FAR_EDGE + 0.01, False),
        (HALF + 0.005, 0, -FAR_EDGE - 0.01, False),
        (HALF + 0.005, 0, -FAR_EDGE + 0.01, True),
        (HALF + 0.02, 0, 0.0, False),
        (HALF + 0.02, 45, 0.0, True),
        (HALF + 0.02, -45, 0.0, True),
        (HALF + 0.04, 45, 0.0, False),
    ):
        position, rotation = lay(tail=0.12, height=height, rotation=turn("y", pitch))
        position[2, 0] = x
        assert touches(bottomless, position, rotation) is expected, (height, pitch, x)


def test_what_is_within_the_limits_has_left_nothing_and_touched_nothing(bottomless: World):
    lowest = TouchedPit().limits(find_state(bottomless, *lay(tail=0.12)))["lowest"][0]
    assert lowest < 2 * HALF
    for pitch in range(0, 360, 15):
        position, rotation = lay(tail=0.12, height=lowest + 1e-6, rotation=turn("y", pitch))
        position[2, 0] = 0.0
        assert not touches(bottomless, position, rotation)


def test_a_pit_with_a_floor_may_be_touched_and_a_way_without_one_has_none(check: World):
    position, rotation = lay(tail=0.12, height=HALF)
    position[2, 0] = 0.0
    assert not touches(check, position, rotation)
    world = find_world(arena="truth", start=(-2.9, 0.0), goal=(-2.1, 0.0), bottomless=True)
    assert not touches(world, *lay(tail=0.3, height=0.0))


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((0.0, 0.99, 0.3), False),
        ((0.0, 1.01, 0.3), True),
        ((0.0, -1.01, 0.3), True),
        ((0.0, 0.0, -0.31), True),
    ],
)
def test_a_module_off_the_side_or_below_all_has_fallen(check: World, place, expected):
    state = find_state(check, [place] * 3)
    assert FellOff()(state)[0] == expected


@pytest.mark.parametrize(("lean", "expected"), [(100, False), (110, True), (180, True)])
def test_a_module_rolls_over_beyond_its_side(check: World, lean, expected):
    state = find_state(check, *lay(tail=0.12, rotation=turn("x", lean)))
    assert RolledOver()(state)[0] == expected


def test_what_no_longer_moves_on_is_stuck(check: World):
    position, rotation = lay(tail=-0.5)
    state, stuck = find_state(check, position, rotation), Stuck(after=0.1, progress=0.02)
    found = []
    for step in (0.0, 0.021, 0.0, 0.019, 0.0, 0.0, 0.0):
        position[:, 0] += step
        state.advance(None, is_sound=True)
        found.append(bool(stuck(state)[0]))
        assert state.tick[0] <= stuck.limits(state)["tick"][0] or found[-1]
    assert found == [False] * 6 + [True]


def test_criteria_grow_with_the_module():
    twice = SuccessCriteria.of(replace(find_world().organism.scout, size=(0.21, 0.21, 0.21)))
    assert twice.ground_band == pytest.approx((0.04, 0.15))
    assert (twice.corner, twice.speed_slack, twice.touch_band) == pytest.approx((0.1, 0.1, 0.02))
    assert SuccessCriteria.of(find_world().organism.scout) == SuccessCriteria()
