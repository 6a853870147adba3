"""Routes over drivable ground, straight ways, and what is said where there is none."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from constants import with_constants

from benchmarks.material.driving_scenes import (
    GALLERY,
    TABLE,
    make_box,
    make_exact_arena,
    make_furnished_room,
    make_terrain,
    make_two_storeys,
)
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.traversability import routes
from symbrion_gym._src.traversability.drivable import DIRECTIONS, keep_upright
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import (
    find_nearest_level,
    find_standing_place,
    find_straight_way,
    find_straight_way_from,
)


@pytest.fixture(scope="module")
def room():
    return make_furnished_room()


@pytest.mark.parametrize("body", [None, snake(2), Footprint(radius=0.2)])
def test_a_route_is_found_without_help(room, body):
    route, ground = room.find_route(body), room.traversability(body)
    assert route.region == 0
    assert 3.0 < route.length < 10.0
    assert route.clearance >= ground.footprint.reach
    assert route.start == tuple(route.path[0])
    assert route.goal == tuple(route.path[-1])
    assert route.path[:, 2] == pytest.approx(0.0)
    steps = np.linalg.norm(np.diff(route.path, axis=0), axis=1)
    assert steps.max() < 1.5 * ground.grid.cell
    assert route.length == pytest.approx(steps.sum())
    assert (ground.region[find_nearest_level(ground, route.path[:, :2], route.path[:, 2])] == 0).all()


def test_a_route_goes_around_the_screen(room):
    route = room.find_route(start=(2.5, 0.5), goal=(3.3, 0.5))
    assert route.path[:, 1].max() > 1.6
    assert route.start[:2] == (2.5, 0.5)
    assert route.goal[:2] == (3.3, 0.5)
    assert 2.8 < route.length < 3.8


def test_a_height_selects_the_storey(room):
    below = room.find_route(start=(1.5, 1.4))
    above = room.find_route(start=(1.5, 1.4, TABLE))
    assert (below.start[2], above.start[2]) == (0.0, pytest.approx(TABLE))
    assert above.path[:, 2] == pytest.approx(TABLE)
    storeys = make_two_storeys()
    up = storeys.find_route(start=(1.0, 2.2, 0.0), goal=(1.0, 2.2, GALLERY))
    assert up.length > 4.0
    assert np.diff(up.path[:, 2]).max() < 0.05


def test_a_given_end_stays_and_the_other_is_far_away(room):
    for ends in ({"start": (0.5, 0.5)}, {"goal": (0.5, 0.5)}):
        route = room.find_route(**ends, max_length=2.0)
        assert 1.5 < route.length <= 2.1
    assert room.find_route(max_length=2.0).length <= 2.0
    with pytest.raises(ArenaError, match="max_length"):
        room.find_route(max_length=0.0)
    assert room.find_route(start=(0.5, 0.5)).heading == pytest.approx(np.pi / 4, abs=np.pi / 2)


def test_from_a_narrow_lane_the_way_ends_at_the_nearest_place_with_room():
    boxes = [((0.0, -1.5, -0.1), (5.0, 1.5, 0.0)), ((5.0, -0.15, -0.1), (8.0, 0.15, 0.0))]
    arena = make_arena(trimesh.boolean.union([trimesh.creation.box(bounds=each) for each in boxes]))
    route = arena.find_route(start=(7.8, 0.0), max_length=1.0)
    assert 2.8 < route.length < 3.5


def test_equal_arenas_give_equal_routes(room):
    one, other = room.find_route(), make_furnished_room().find_route()
    assert np.array_equal(one.path, other.path)
    assert (one.heading, one.length, one.clearance) == (other.heading, other.length, other.clearance)


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ({"start": (1.0, 1.0, 2.46)}, r"no drivable ground .* nearest possible place is"),
        ({"start": (9.0, 9.0)}, r"in arena 'room'; the nearest possible place is \(3\.\d+, 2\.\d+"),
        ({"start": (2.81, 0.5)}, r"nearest possible place is \(2"),
        ({"start": (0.5, 0.5), "goal": (1.5, 1.4, TABLE)}, "goal .* is not connected to the start"),
        ({"start": (0.5, 0.5), "goal": (0.5, 0.5)}, "same place"),
        ({"goal": (0.5,)}, "goal must be a place"),
        ({"goal": (0.5, np.nan)}, "goal must be a place"),
        ({"goal": "table"}, "goal must be a place"),
    ],
)
def test_impossible_ends_are_refused_with_the_nearest_place(room, ends, message):
    with pytest.raises(ArenaError, match=message):
        room.find_route(**ends)


def test_the_longest_straight_way_of_a_hall_runs_between_its_corners():
    floor = make_box((0, 0, -0.1), (3, 1, 0))
    ground = make_exact_arena("hall", [floor], [floor]).traversability()
    back, forth = find_straight_way(ground)
    assert np.linalg.norm(forth - back) == pytest.approx(np.hypot(2.65, 0.65), abs=0.12)  # 17 cm off the rims
    assert back[0] < forth[0]
    assert find_straight_way(replace(ground, region=np.full(len(ground.cell), -1))) is None


def test_straight_ways_end_at_walls(room):
    ground = room.traversability()
    is_usable = ground.region == 0
    start = find_standing_place(ground, "start", (2.5, 0.5), "room")
    end = find_straight_way_from(ground, is_usable, start)
    assert end[0] < 2.8
    back, forth = find_straight_way(ground)
    line = np.linspace(back, forth, 200)
    assert not ((np.abs(line[:, 0] - 2.81) < 0.05) & (line[:, 1] < 1.6)).any()


def test_a_side_slope_is_crossed_straight_up_and_not_along():
    links = np.zeros((1, 8), dtype=np.int64)
    steep = np.array([[0.0, np.tan(0.3)]])  # rises along y by 17 degrees
    body = Footprint(max_slope=0.5, max_roll=0.2)
    kept = keep_upright(links, steep, body)[0] >= 0
    assert kept.tolist() == (DIRECTIONS[:, 0] == 0).tolist()
    assert (keep_upright(links, steep, Footprint(max_slope=0.5, max_roll=0.31)) >= 0).all()
    assert (keep_upright(links, np.full((1, 2), np.nan), body) >= 0).all()


def test_ends_lie_on_level_ground_and_paths_avoid_slopes():
    arena = make_terrain(7, roughness=0.05)
    ground, route = arena.traversability(), arena.find_route()
    numbers = find_nearest_level(ground, route.path[:, :2], route.path[:, 2])
    slope = ground.slope[numbers]
    assert max(slope[0], slope[-1]) < ground.footprint.max_roll / 2
    with with_constants(routes, slope_cost=0.0):
        short = arena.find_route(start=route.start, goal=route.goal)
    crossed = find_nearest_level(ground, short.path[:, :2], short.path[:, 2])
    assert slope.mean() < ground.slope[crossed].mean()
    assert short.length < route.length


def test_no_ground_is_told_with_the_axis():
    wall = make_box((0.0, 0.0, 0.0), (0.02, 3.0, 2.0))
    with pytest.raises(ArenaError, match="--up y"):
        make_exact_arena("wall", [wall], [wall]).find_route()


def make_icy_floor(friction: float, *, is_ramp: bool = False) -> Arena:
    """Return a floor of 4 m x 2 m, level or rising by 0.2 along x, with ice but for a way at its side."""
    floor = trimesh.Trimesh(
        [(0, 0, 0), (4, 0, 0.8 * is_ramp), (4, 2, 0.8 * is_ramp), (0, 2, 0)],
        [(0, 1, 2), (0, 2, 3)],
        process=False,
    )
    ice = FrictionPatch.of_rectangle((1.5, 0.6), (2.5, 2.0), friction)
    return make_arena(floor, friction=0.7, friction_map=FrictionMap((ice,)), kind="convex", cache=False)


def test_a_route_goes_around_ice_but_not_around_ground_that_holds():
    ends = {"start": (0.5, 1.3), "goal": (3.5, 1.3)}
    for friction, is_around in ((0.1, True), (0.65, False)):
        path = make_icy_floor(friction).find_route(**ends).path
        is_beside = (path[:, 0] > 1.5) & (path[:, 0] < 2.5)
        assert (path[is_beside, 1].max() < 0.6) == is_around


def test_ends_are_not_chosen_on_ice():
    arena = make_icy_floor(0.1)
    route = arena.find_route()
    ends = np.array([route.start, route.goal])
    assert (arena.find_friction(ends) == 0.7).all()


def test_ice_on_a_slope_that_it_does_not_hold_costs_more_than_level_ice():
    ends = {"start": (0.5, 1.3), "goal": (3.5, 1.3)}
    with with_constants(routes, slip_cost=0.5):
        level, ramp = (make_icy_floor(0.1, is_ramp=is_ramp).find_route(**ends) for is_ramp in (False, True))
    assert level.path[:, 1].min() > 0.6
    assert ramp.path[:, 1].min() < 0.6
