"""The strict test of success: bodies laid beyond the pit by hand, with one thing wrong at a time."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import trimesh
from symbrion_gym.tasks.success_check import (
    Measures,
    OrganismState,
    SuccessCheck,
    SuccessCriteria,
    find_ceiling,
)

from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.environment.world import World

FAR_EDGE = 0.1
"""Of a pit 0.2 m wide [m]."""
PLATEAU = 0.25
"""Its height [m]."""
HALF = 0.0525
"""Half the height and width of a module [m]: its center above the ground, whichever of four sides it lies on."""


@cache
def find_world(modules: int = 3, **options: Any) -> World:
    """Return a world that is compiled once; what judges in it is made for each test."""
    return World(SnakePitConfig(modules=modules, **options))


@pytest.fixture
def check() -> SuccessCheck:
    return find_world(pit=2 * FAR_EDGE).make_success_check()


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


def test_a_body_that_stands_beyond_the_pit_has_arrived(check: SuccessCheck):
    assert check.is_standing(*lay(tail=0.06))
    assert check.is_standing(*lay(tail=0.3))


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("angle", "stands"), [(40, True), (-40, True), (90, False), (-90, False), (75, False)]
)
def test_a_module_on_its_side_or_on_its_end_is_no_success(check: SuccessCheck, axis, angle, stands):
    assert check.is_standing(*lay(tail=0.12, rotation=turn(axis, angle))) is stands


@pytest.mark.parametrize("above", [HALF - 0.02, HALF + 0.01])
def test_a_module_may_sink_in_or_ride_up_a_little(check: SuccessCheck, above):
    assert check.is_standing(*lay(tail=0.12, height=PLATEAU + above))


@pytest.mark.parametrize("above", [HALF + 0.2, HALF + 0.105, HALF + 0.04, 0.0, -0.05])
def test_a_module_stacked_on_another_or_in_the_ground_is_no_success(check: SuccessCheck, above):
    assert not check.is_standing(*lay(tail=0.12, height=PLATEAU + above))


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
def test_a_corner_that_is_not_yet_beyond_the_edge_is_no_success(check: SuccessCheck, tail, yaw, stands):
    """What must be beyond is a cube of 0.1 m in the module, so a turned one must have gone farther."""
    assert check.is_standing(*lay(tail, rotation=turn("z", yaw))) is stands


def test_one_module_left_behind_is_no_success(check: SuccessCheck):
    position, rotation = lay(tail=0.12)
    position[2, 0] = -FAR_EDGE - 0.1
    assert not check.is_standing(position, rotation)


def measure(check: SuccessCheck, places: np.ndarray, **parts: np.ndarray) -> Measures:
    """Measure modules at `places` `[n, 3]` [m], at rest and upright but for what `parts` say."""
    still = {"rates": np.zeros(8), "up": np.ones(3), "torque": np.zeros(2), "hinge_rate": np.zeros(2)}
    return check.measure(OrganismState(positions=np.asarray(places, float).T, **(still | parts)))


def test_what_is_measured_of_a_body(check: SuccessCheck):
    places = [[0.3, 0.02, 0.31], [0.0, -0.07, 0.29], [-0.24, 0.04, 0.33]]
    measured = measure(
        check,
        places,
        up=np.array([0.9, -0.2, 0.7]),
        torque=np.array([2.0, -3.0]),
        hinge_rate=np.array([-0.5, -0.1]),
    )
    assert (measured.head, measured.mean) == pytest.approx((0.3, 0.02))
    assert (measured.lateral, measured.lowest, measured.uprightness) == pytest.approx((0.07, 0.29, -0.2))
    assert measured.power == pytest.approx(1.3)
    assert not measured.is_across
    assert measured.is_sound
    mirrored = measure(check, np.array(places) * [1, -1, 1])
    assert mirrored.lateral == pytest.approx(0.07)


def test_no_module_makes_progress_beyond_the_finish(check: SuccessCheck):
    finish = FAR_EDGE + 0.1254 / 2
    assert check.finish == pytest.approx(finish)
    some = measure(check, [[finish + 0.2, 0, 0.3], [finish + 0.1, 0, 0.3], [finish - 0.1, 0, 0.3]])
    assert some.progress == pytest.approx(finish - 0.1 / 3)
    assert some.mean == pytest.approx(finish + 0.2 / 3)
    assert not some.is_across
    everything = measure(check, [[finish + 0.2, 0, 0.3], [finish + 0.1, 0, 0.3], [finish + 0.01, 0, 0.3]])
    assert everything.progress == pytest.approx(finish)
    assert everything.is_across
    before = measure(check, [[finish - 0.1, 0, 0.3]] * 3)
    assert before.progress == before.mean == pytest.approx(finish - 0.1)
    assert before.is_across is False


def test_a_body_without_hinges_needs_no_power():
    measured = measure(
        find_world(1).make_success_check(), [[0.0, 0.0, 0.3]], torque=np.zeros(0), hinge_rate=np.zeros(0)
    )
    assert measured.power == 0.0


def test_a_robot_takes_itself_to_start_as_far_from_the_middle_of_the_pit_as_its_map_says():
    world = World(SnakePitConfig(modules=3, pit=2 * FAR_EDGE))
    assert world.make_success_check().start == world.route.start
    world.map_route = replace(world.map_route, start=-1.0, pit=(0.3, 0.7, 0.0))
    assert world.make_success_check().start == pytest.approx(-1.5)
    world.map_route = replace(world.map_route, pit=None)
    assert world.make_success_check().start == -1.0


@pytest.mark.parametrize(
    ("rates", "is_sound"),
    [
        (np.full(8, 10.0), True),
        (np.full(8, -49.0), True),
        (np.r_[np.zeros(7), 49.9], True),
        (np.r_[np.zeros(7), 50.1], False),
        (np.r_[-50.1, np.zeros(7)], False),
        (np.r_[np.nan, np.zeros(7)], False),
        (np.r_[np.zeros(7), np.inf], False),
    ],
)
def test_numbers_that_are_no_longer_physics_are_seen(check: SuccessCheck, rates, is_sound):
    measured = measure(check, np.full((3, 3), 0.3), rates=rates)
    assert measured.is_sound is is_sound
    assert (measured.head, measured.lowest) == ((0.3, 0.3) if is_sound else (0.0, 0.0))
    assert measured.is_across is is_sound


@pytest.mark.parametrize(("frame_skip", "ticks"), [(10, 15), (20, 8), (100, 2), (200, 1)])
def test_a_body_must_stand_for_three_tenths_of_a_second(check: SuccessCheck, frame_skip, ticks):
    config = SnakePitConfig(modules=3, pit=2 * FAR_EDGE, frame_skip=frame_skip, timestep=0.002)
    assert World(config).make_success_check().hold_ticks == ticks


@pytest.fixture
def turned() -> SuccessCheck:
    """Of a way across the flat floor, neither along x nor through the middle."""
    return find_world(arena="truth", start=(-2.9, -0.6), goal=(-2.1, 0.2)).make_success_check()


def test_on_a_turned_way_all_is_measured_along_it(turned: SuccessCheck):
    """It begins at (-2.9, -0.6), goes to the left of x by 45 degrees, and ends where the head is at its goal."""
    ahead, left = np.array([1.0, 1.0]) / np.sqrt(2), np.array([-1.0, 1.0]) / np.sqrt(2)
    start = np.array([-2.9, -0.6])
    begin = start @ ahead
    assert turned.finish == pytest.approx(begin + np.hypot(0.8, 0.8) - 2 * 0.1254)
    steps, aside = np.array([0.5, 0.3, 0.1]), np.array([0.1, -0.2, 0.05])
    places = np.column_stack([start + np.outer(steps, ahead) + np.outer(aside, left), np.full(3, HALF)])
    measured = measure(turned, places)
    assert (measured.head, measured.mean, measured.lateral) == pytest.approx((begin + 0.5, begin + 0.3, 0.2))
    assert turned.find_distance(places[None])[0] == pytest.approx(begin + steps)
    along, across = turned.find_coordinates(places)
    assert along == pytest.approx(begin + steps)
    assert across == pytest.approx(aside)


def test_a_way_along_x_need_not_be_in_the_middle():
    check = find_world(arena="truth", start=(-2.9, 0.5), goal=(-2.1, 0.5)).make_success_check()
    places = np.array([[-2.4, 0.45, HALF], [-2.5, 0.5, HALF], [-2.6, 0.58, HALF]])
    measured = measure(check, places)
    assert (measured.head, measured.mean, measured.lateral) == pytest.approx((-2.4, -2.5, 0.08))
    assert np.array(check.find_coordinates(places)) == pytest.approx(places[:, :2].T - [[0], [0.5]])


@pytest.mark.parametrize(("heading", "lateral"), [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (np.pi / 2, 0.0)])
def test_places_are_measured_along_and_beside_any_way(heading, lateral):
    world = World(SnakePitConfig(modules=3, pit=2 * FAR_EDGE))
    world.route = replace(world.route, heading=heading, lateral=lateral)
    places = np.array([[0.3, 0.02, 0.31], [0.0, -0.07, 0.29]])
    ahead, left = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    along, across = world.make_success_check().find_coordinates(places)
    assert along == pytest.approx(places[:, :2] @ ahead)
    assert across == pytest.approx(places[:, :2] @ left - lateral)


def test_places_on_a_straight_way_are_x_and_y(check: SuccessCheck):
    places = np.array([[0.3, 0.02, 0.31], [0.0, -0.07, 0.29]])
    assert check.find_distance(places[None]) == pytest.approx(places[None, :, 0])
    assert np.array(check.find_coordinates(places)) == pytest.approx(places[:, :2].T)


@pytest.mark.parametrize(
    ("tail", "yaw", "stands"), [(0.06, 45, True), (0.06, 0, False), (0.08, 0, True), (0.04, 45, False)]
)
def test_on_a_turned_way_corners_count_along_it(turned: SuccessCheck, tail, yaw, stands):
    """The edge is half a module's length before the finish."""
    ahead = np.array([1.0, 1.0]) / np.sqrt(2)
    steps = turned.finish - 0.1254 / 2 + tail + 0.1254 * np.arange(3)[::-1]
    position, rotation = lay(tail=0.12)
    left = np.array([-2.9, -0.6]) @ [-1.0, 1.0] / 2 * np.array([-1.0, 1.0])
    position[:] = np.column_stack([left + np.outer(steps, ahead), np.full(3, HALF)])
    rotations = np.array([turn("z", 45), turn("z", 45), turn("z", yaw)])
    rotation[:] = rotations.reshape(3, 9)
    assert turned.is_standing(position, rotation) is stands


@pytest.mark.parametrize(("yaw", "stands"), [(1, True), (-1, False)])
def test_on_a_way_to_the_left_a_module_turned_to_the_right_reaches_farther_back(yaw, stands):
    """The way turns by the angle of a triangle of sides 3, 4 and 5; so does a module along it."""
    check = find_world(arena="truth", start=(-2.9, -0.6), goal=(-2.1, 0.0)).make_success_check()
    ahead, left = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    steps = check.finish - 0.1254 / 2 + 0.06 + 0.1254 * np.arange(3)[::-1]
    position, rotation = lay(tail=0.12)
    middle = (np.array([-2.9, -0.6]) @ left) * left
    position[:] = np.column_stack([middle + np.outer(steps, ahead), np.full(3, HALF)])
    angle = np.degrees(np.arcsin(0.6))
    rotations = np.array([turn("z", angle), turn("z", angle), turn("z", yaw * angle)])
    rotation[:] = rotations.reshape(3, 9)
    assert check.is_standing(position, rotation) is stands


@pytest.fixture
def bottomless() -> SuccessCheck:
    return find_world(pit=2 * FAR_EDGE, bottomless=True).make_success_check()


def test_a_module_that_touches_the_floor_of_the_pit_is_seen(bottomless: SuccessCheck):
    assert bottomless.is_bottomless
    for height, pitch, x, touches in (
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
        assert bottomless.has_touched_pit(position, rotation) is touches, (height, pitch, x)


def test_what_is_within_the_limits_has_left_nothing_and_touched_nothing(
    check: SuccessCheck, bottomless: SuccessCheck
):
    course = 2.0, -0.3
    assert check.find_limits() == pytest.approx((course[0] / 2, course[1]))
    assert not check.is_bottomless
    aside, lowest = bottomless.find_limits()
    assert aside == pytest.approx(course[0] / 2)
    assert lowest < 2 * HALF
    for pitch in range(0, 360, 15):
        position, rotation = lay(tail=0.12, height=lowest + 1e-6, rotation=turn("y", pitch))
        position[2, 0] = 0.0
        assert not bottomless.has_touched_pit(position, rotation)


def test_criteria_can_be_chosen():
    wide = SuccessCriteria(hold_time=1.0, upright=0.2, ground_band=(0.02, 0.2), corner=0.0, max_rate=5.0)
    world = World(SnakePitConfig(modules=3, pit=2 * FAR_EDGE, criteria=wide))
    check = world.make_success_check()
    assert check.hold_ticks == 50
    assert check.is_standing(*lay(tail=0.01, height=PLATEAU + HALF + 0.04, rotation=turn("x", 75)))
    assert not measure(check, np.full((3, 3), 0.3), rates=np.full(8, 6.0)).is_sound


def test_a_way_without_a_pit_has_no_abyss():
    check = find_world(
        arena="truth", start=(-2.9, 0.0), goal=(-2.1, 0.0), bottomless=True
    ).make_success_check()
    assert not check.is_bottomless
    position, rotation = lay(tail=0.3, height=0.0)
    assert not check.has_touched_pit(position, rotation)
    assert check.find_limits() == (check.max_lateral, check.lowest)


def make_wall(x: float, height: float, length: float = 0.0) -> np.ndarray:
    """Return two triangles from the ground up to a height, along x as well if they have a length there [m]."""
    low, high = [[x, -1, 0], [x, 1, 0]], [[x + length, 1, height], [x + length, -1, height]]
    corners = np.array([*low, *high], dtype=float)
    return corners[[[0, 1, 2], [0, 2, 3]]]


def make_soup(*parts: np.ndarray) -> trimesh.Trimesh:
    triangles = np.concatenate(parts)
    return trimesh.Trimesh(
        triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False
    )


def find_highest(surface: trimesh.Trimesh, x: np.ndarray) -> np.ndarray:
    ends, ceiling = find_ceiling(surface)
    return ceiling[np.searchsorted(ends, x)]


def test_the_ceiling_is_the_greatest_height_nearby():
    tiles = [make_wall(x, 0.0, 0.02) for x in np.arange(0.0, 1.0, 0.02)]
    surface = make_soup(*tiles, make_wall(0.43, 1.0), make_wall(0.6, 2.0, 0.3))
    x = np.linspace(0, 1, 1001)
    highest = find_highest(surface, x)
    near_wall, on_slope = np.abs(x - 0.43) < 0.005, (x > 0.6) & (x < 0.9)
    apart = (np.abs(x - 0.43) > 0.055) & ((x < 0.545) | (x > 0.955))
    assert highest[near_wall] == pytest.approx(1.0, abs=1e-5)
    assert highest[on_slope] == pytest.approx(2.0, abs=1e-5)
    assert highest[apart] == pytest.approx(0.0, abs=1e-5)
    assert np.isneginf(find_highest(surface, np.array([-5.0, -0.11]))).all()


def test_what_stands_where_two_strips_meet_is_in_both():
    floor = make_wall(0.0, 0.0, 1.0)
    for end in find_ceiling(make_soup(floor))[0][1:-1]:
        highest = find_highest(make_soup(floor, make_wall(end, 1.0)), end + np.array([-1e-9, 0.0, 1e-9]))
        assert (highest >= 1.0).all()
