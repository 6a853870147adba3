"""Where a body starts, which way it goes, and where it has arrived; what is done at the start is refused."""

from dataclasses import replace

import gymnasium as gym
import mujoco
import numpy as np
import pytest
import trimesh

from benchmarks.material.bare_surfaces import make_bare
from benchmarks.material.driving_scenes import (
    CEILING,
    TABLE,
    make_box,
    make_exact_arena,
    make_furnished_room,
    make_terrain,
)
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import cross, snake
from symbrion_gym._src.tasks.route import find_route


@pytest.fixture(scope="module")
def truth():
    return Arena.from_course(Course())


@pytest.fixture(scope="module")
def bare(truth):
    return replace(truth, course=None)


@pytest.fixture(scope="module")
def room():
    return make_furnished_room()


def test_a_pit_is_crossed_when_the_whole_last_module_is_beyond(truth):
    route = find_route(truth, snake(8))
    assert route.finish == pytest.approx(0.225 + 0.0627)
    assert route.start == pytest.approx(-1.725 - 0.1 - 0.072)
    assert route.pit == pytest.approx((-0.225, 0.225, 0.0))
    near = find_route(truth, snake(8), start="pit")
    assert near.start == pytest.approx(-0.225 - 0.2 - 0.072)


def test_a_way_between_two_places_has_their_direction(truth):
    route = find_route(truth, snake(3), start=(-2.0, 0.5), goal=(-1.0, -0.5))
    assert route.heading == pytest.approx(-np.pi / 4)
    assert route.place(route.start) == pytest.approx((-2.0, 0.5))


def test_a_surface_without_course_is_crossed_along_its_longer_side():
    route = find_route(replace(Arena.from_course(Course(pit=0.0)), course=None), snake(4))
    assert (route.heading, route.pit) == (0.0, None)
    assert -3.3 < route.start < -2.0
    assert 2.0 < route.finish < 3.3


def test_the_pit_of_a_surface_without_course_is_the_finish(truth, bare):
    for start in ("floor", "pit"):
        route, known = (find_route(arena, snake(4), start) for arena in (bare, truth))
        found = (route.heading, route.lateral, route.start, route.finish, route.lowest, *route.pit)
        exact = (known.heading, known.lateral, known.start, known.finish, known.lowest, *known.pit)
        assert found == pytest.approx(exact, abs=1e-3)
        assert route.half_width == pytest.approx(known.half_width, abs=0.011)


@pytest.mark.parametrize("name", ["gsrm", "gg"])
def test_the_route_of_a_scan_is_nearly_that_of_the_truth(truth, name):
    scanned = load_arena(name, Course())
    assert scanned.course is None
    for start in ("floor", "pit"):
        route, known = (find_route(arena, snake(8), start) for arena in (scanned, truth))
        assert (route.start, route.finish) == pytest.approx((known.start, known.finish), abs=0.005)
        assert route.pit == pytest.approx(known.pit, abs=0.005)
        assert route.half_width == pytest.approx(known.half_width, abs=0.03)
        assert (route.heading, route.lateral) == (0.0, 0.0)


def test_a_pit_on_a_given_way_is_its_finish(bare):
    route = find_route(bare, snake(3), start=(-1.2, 0.3))
    near, far, _ = route.pit
    assert route.place(near)[0] == pytest.approx(-0.225, abs=0.01)
    assert route.finish == pytest.approx(far + 0.0627)
    assert find_route(bare, snake(3), start=(0.5, 0.3)).pit is None


def test_a_surface_without_a_ramp_is_crossed_from_its_rim():
    ground = np.array([[-2.0, 0.25], [-0.2, 0.25], [-0.2, 0.0], [0.2, 0.0], [0.2, 0.25], [2.0, 0.25]])
    points = np.concatenate([np.insert(ground, 1, y, axis=1) for y in (-1.0, 1.0)])
    faces = [face for i in range(5) for face in ([i, i + 1, i + 7], [i, i + 7, i + 6])]
    route = find_route(make_bare(trimesh.Trimesh(points, faces, process=False)), snake(4))
    assert route.start == pytest.approx(-2.0 + 3 * 0.1254 + 0.0525 + 0.02, abs=0.011)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": (0.0, 5.0), "goal": (0.0, 0.0)}, "start .* off the surface"),
        ({"start": (-2.0, 0.0), "goal": (9.0, 0.0)}, "goal .* off the surface"),
        ({"start": (-2.0, 0.0), "goal": (-2.0, 0.0)}, "same place"),
        ({"start": (np.nan, 0.0), "goal": (-2.0, 0.0)}, "start must be a place"),
        ({"start": "pit", "goal": (1.0, 0.0)}, "no known pit"),
    ],
)
def test_impossible_ways_are_refused(truth, options, message):
    with pytest.raises(ArenaError, match=message):
        find_route(truth, snake(3), **options)


def test_what_has_no_pit_is_not_started_before_it():
    with pytest.raises(ArenaError, match="no pit"):
        find_route(Arena.from_course(StairsCourse(), "stairs"), snake(3), start="pit")
    with pytest.raises(ArenaError, match=r"to start before \(no gap on the way"):
        find_route(make_bare(Course(pit=0.0).surface()), snake(3), start="pit")


def test_the_pit_of_a_ready_arena_cannot_be_resized(truth):
    with pytest.raises(ArenaError, match=r"cannot be set to 0\.3"):
        World(EnvironmentConfig(arena=truth, pit=0.3))


@pytest.mark.parametrize("start", ["floor", "pit", (-1.2, 0.3)])
def test_a_body_is_laid_down_on_the_ground(start):
    goal = (2.0, 0.0) if isinstance(start, tuple) else None
    world = World(EnvironmentConfig(modules=6, start=start, goal=goal))
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.lay_down(offset=0.03, yaw=0.05)
    data.ctrl[world.servos] = data.qpos[world.hinge_qpos]
    mujoco.mj_forward(world.model, data)
    assert min((contact.dist for contact in data.contact), default=0.0) > -0.004
    mujoco.mj_step(world.model, data, nstep=60)
    centers = data.xpos[world.modules]
    ground = world.arena.height(centers[:, 0], centers[:, 1])
    assert (centers[:, 2] - ground < 0.075).all()


def test_a_room_is_crossed_below_its_ceiling(room):
    route = find_route(room, snake(4))
    assert route.start_height == 0.0
    assert route.finish - route.start > 2.0
    x, y = route.place(np.linspace(route.start - 0.4, route.finish + 0.4, 200))
    assert ((x > 0) & (x < 4) & (y > 0) & (y < 3)).all()
    assert not ((np.abs(x - 2.81) < 0.05) & (y < 1.65)).any()


@pytest.mark.parametrize(
    ("modules", "ends", "ground"),
    [
        (5, {}, 0.0),
        (cross(1), {"start": (1.5, 1.4), "goal": (1.5, 0.3)}, 0.0),
        (5, {"start": (1.8, 1.4, TABLE), "goal": (2.1, 1.4, TABLE)}, TABLE),
        (1, {"goal": (2.0, 0.3)}, 0.0),
        (5, {"start": (0.7, 2.5)}, 0.0),
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


def test_open_ground_is_crossed_through_its_middle():
    floor = make_box((0, 0, -0.1), (4, 2, 0))
    route = find_route(make_exact_arena("open", [floor], [floor]), snake(3))
    assert (route.heading, route.lateral, route.start_height) == (0.0, 1.0, None)
    assert route.start == pytest.approx(0.25 + 2 * 0.1254)
    stairs = replace(Arena.from_course(StairsCourse()), course=None)
    assert find_route(stairs, snake(3)).heading == 0.0
    assert find_route(make_terrain(0), snake(3)).start_height is None


def test_a_wall_across_the_middle_is_avoided():
    floor, wall = make_box((0, 0, -0.1), (4, 2, 0)), make_box((2, 0.5, 0), (2.2, 1.5, 0.5))
    route = find_route(make_exact_arena("wall", [floor, wall], [floor, wall]), snake(2))
    x, y = route.place(np.linspace(route.start, route.finish, 200))
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


def test_an_arena_without_a_long_enough_way_is_refused(room):
    with pytest.raises(ArenaError, match="no straight way of 6"):
        find_route(room, snake(50))
    corners = np.array([(0, 0, CEILING), (4, 0, CEILING), (4, 3, CEILING), (0, 3, CEILING)])
    ceiling = trimesh.Trimesh(corners, [(0, 2, 1), (0, 3, 2)])
    empty = make_exact_arena("none", room.pieces, [ceiling])
    with pytest.raises(ArenaError, match="no ground to stand on"):
        find_route(empty, snake(2), start=(1.0, 1.0), goal=(2.0, 2.0))


def make(name: str, **options) -> None:
    gym.make(f"symbrion_gym/{name}", **{"arena": "truth", "modules": 2, **options}).close()


@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_a_start_beyond_the_pit_is_refused_with_its_edges(arena):
    message = r"start \(0.6, 0\) lies beyond the pit .* far edge is 0.2\d m .* near edge, at -0.2"
    with pytest.raises(TaskError, match=message):
        make("SnakePit-v1", arena=arena, start=(0.6, 0.0))
    make("SnakePit-v1", arena=arena, start=(-0.6, 0.0))


def test_beyond_the_pit_there_may_be_a_goal_or_another_task():
    make("SnakePit-v1", start=(0.6, 0.0), goal=(2.0, 0.0))
    make("Traverse-v0", start=(0.6, 0.0))
    make("SnakePit-v1", pit=0.0, start=(0.6, 0.0))


@pytest.mark.parametrize(
    ("name", "arena", "start"), [("CrossGap-v0", "truth", 1.0), ("Climb-v0", "stairs", 1.0)]
)
def test_a_start_beyond_the_finish_is_refused(name, arena, start):
    """It would be a success at once."""
    with pytest.raises(ArenaError, match="lies beyond the finish"):
        make(name, arena=arena, modules=3, start=(start, 0.0))


def test_a_goal_at_the_start_is_refused_with_the_least_distance():
    lone = {"modules": 1, "start": (-2.5, 0.0)}
    message = r"goal \(-2.\d+, -?0.0\d\) is 0.0\d m from the middle .* within 0.1\d m; give one at least 0.16 m away"
    with pytest.raises(TaskError, match=message):
        make("Reach-easy-v0", goal=(-2.45, 0.0), **lone)
    with pytest.raises(TaskError, match=r"distance 0.05 m is too short, .* at least 0.16 m"):
        make("Reach-easy-v0", distance=0.05, modules=1)
    make("Reach-easy-v0", goal=(-2.2, 0.0), **lone)
    make("Reach-easy-v0", places=((-2.0, 0.0),), goal=(-2.5, 0.0), **lone)
    make("Reach-easy-v0", goal=(-2.35, 0.0), tolerance=0.03, **lone)
    with pytest.raises(TaskError, match=r"0.05 m ahead of the head at the start; give one at least 0.1\d m"):
        make("SnakePit-v1", start=(-2.5, 0.0), goal=(-2.45, 0.0))


@pytest.mark.parametrize(
    ("modules", "pit", "is_bridged"), [(8, 0.45, True), (4, 0.45, False), (8, 0.6, False)]
)
def test_a_traverse_goes_on_beyond_a_gap_that_the_body_may_bridge(modules, pit, is_bridged):
    env = gym.make("symbrion_gym/Traverse-v0", arena="truth", pit=pit, modules=modules).unwrapped
    assert (env.world.route.finish > pit / 2) == is_bridged  # pyright: ignore
    assert (env.world.route.finish > -pit / 2) == is_bridged  # pyright: ignore
