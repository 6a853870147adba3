"""Start and goal in arenas without a course: on the ground, below ceilings and tables, never on top of them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from benchmarks.material.driving_scenes import (
    CEILING,
    TABLE,
    make_box,
    make_exact_arena,
    make_furnished_room,
    make_terrain,
)
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import StairsCourse
from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import cross, snake
from symbrion_gym._src.tasks.route import find_route


@pytest.fixture(scope="module")
def room():
    return make_furnished_room()


def test_a_room_is_crossed_below_its_ceiling(room):
    route = find_route(room, snake(4))
    assert route.start_height == 0.0
    assert route.finish - route.start > 2.0
    s = np.linspace(route.start - 0.4, route.finish + 0.4, 200)
    x, y = route.place(s)
    assert ((x > 0) & (x < 4) & (y > 0) & (y < 3)).all()
    assert not ((np.abs(x - 2.81) < 0.05) & (y < 1.65)).any()


@pytest.mark.parametrize("modules", [1, 5, cross(1)])
@pytest.mark.parametrize(
    ("ends", "ground"),
    [
        ({}, 0.0),
        ({"start": (1.5, 1.4), "goal": (1.5, 0.3)}, 0.0),
        ({"start": (1.8, 1.4, TABLE), "goal": (2.1, 1.4, TABLE)}, TABLE),
        ({"goal": (2.0, 0.3)}, 0.0),
        ({"start": (0.7, 2.5)}, 0.0),
    ],
)
def test_a_body_is_laid_on_the_storey_that_is_meant(room, modules, ends, ground):
    world = World(EnvironmentConfig(arena=room, modules=modules, **ends))
    qpos = world.lay_down(offset=0.02, yaw=0.03)
    assert qpos[2] == pytest.approx(ground + 0.0525, abs=0.01)
    assert qpos[world.hinge_qpos] == pytest.approx(0.0, abs=0.2)


def test_a_success_below_a_ceiling_counts(room):
    env = OrganismEnv(arena=room, modules=1, start=(0.5, 2.5), goal=(1.0, 2.5))
    env.reset(seed=0)
    info, is_over = {}, False
    while not is_over:
        _, _, terminated, truncated, info = env.step(np.zeros(env.action_space.shape))
        is_over = terminated or truncated
    assert info["success"]
    assert env.physics.position[0, 0, 2] < 0.1


def test_open_ground_is_crossed_through_its_middle_as_before():
    floor = make_box((0, 0, -0.1), (4, 2, 0))
    open_floor = make_exact_arena("open", [floor], [floor])
    route = find_route(open_floor, snake(3))
    assert (route.heading, route.lateral, route.start_height) == (0.0, 1.0, None)
    assert route.start == pytest.approx(0.25 + 2 * 0.1254)
    stairs = Arena.from_course(StairsCourse(), "stairs")
    bare = replace(stairs, course=None)
    assert find_route(bare, snake(3)).heading == 0.0
    assert find_route(make_terrain(0), snake(3)).start_height is None


def test_a_wall_across_the_middle_is_avoided():
    floor, wall = make_box((0, 0, -0.1), (4, 2, 0)), make_box((2, 0.5, 0), (2.2, 1.5, 0.5))
    arena = make_exact_arena("wall", [floor, wall], [floor, wall])
    route = find_route(arena, snake(2))
    s = np.linspace(route.start, route.finish, 200)
    x, y = route.place(s)
    assert not ((x > 1.95) & (x < 2.25) & (y > 0.45) & (y < 1.55)).any()


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ({"start": (0.5, 2.5, CEILING + 0.06)}, "start .* off the ground .* nearest possible place is"),
        (
            {"start": (0.5, 2.5), "goal": (1.0, 5.0)},
            r"goal \(1.0, 5.0\) lies outside .* over x 0 to 4 m, y 0 to 3 m",
        ),
        ({"start": (0.5, 2.5), "goal": (0.5, 2.5)}, "same place"),
        ({"start": (0.5,)}, "start must be a place"),
    ],
)
def test_places_off_the_ground_are_refused(room, ends, message):
    with pytest.raises(ArenaError, match=message):
        find_route(room, snake(2), **ends)


def test_a_place_outside_is_refused_before_the_ground_is_mapped(room, monkeypatch):
    monkeypatch.setattr(Arena, "traversability", lambda *_: pytest.fail("mapped"))
    with pytest.raises(ArenaError, match="outside of arena"):
        find_route(room, snake(2), start=(50.0, 0.0), goal=(1.0, 1.0))


def test_an_arena_without_a_long_enough_way_is_refused():
    small = make_furnished_room(4.0, 3.0)
    with pytest.raises(ArenaError, match="no straight way of 6"):
        find_route(small, snake(50))
    corners = np.array([(0, 0, CEILING), (4, 0, CEILING), (4, 3, CEILING), (0, 3, CEILING)])
    ceiling = trimesh.Trimesh(corners, [(0, 2, 1), (0, 3, 2)])
    empty = make_exact_arena("none", small.pieces, [ceiling])
    with pytest.raises(ArenaError, match="no ground to stand on"):
        find_route(empty, snake(2), start=(1.0, 1.0), goal=(2.0, 2.0))
