"""Where a body starts, which way it goes, and where it has arrived."""

import mujoco
import numpy as np
import pytest
import trimesh

from benchmarks.material.bare_surfaces import make_bare
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.tasks.route import RouteMargins, find_route


@pytest.fixture(scope="module")
def truth():
    return Arena.from_course(Course())


def test_a_pit_is_crossed_when_the_whole_last_module_is_beyond(truth):
    route = find_route(truth, snake(8))
    assert route.finish == pytest.approx(0.225 + 0.0627)
    assert route.start < -1.7 - 0.072
    assert route.pit == pytest.approx((-0.225, 0.225, 0.0))
    near = find_route(truth, snake(8), start="pit")
    assert near.start == pytest.approx(-0.225 - 0.2 - 0.072)


def test_margins_can_be_chosen(truth):
    margins = RouteMargins(before_foot=0.2, before_pit=0.4, below=1.0)
    usual, wide = find_route(truth, snake(8)), find_route(truth, snake(8), margins=margins)
    assert wide.start == pytest.approx(usual.start - 0.1)
    assert wide.lowest == pytest.approx(-1.0)
    near = find_route(truth, snake(8), start="pit", margins=margins)
    assert near.start == pytest.approx(-0.225 - 0.4 - 0.072)


def test_a_way_between_two_places_has_their_direction(truth):
    route = find_route(truth, snake(3), start=(-2.0, 0.5), goal=(-1.0, -0.5))
    assert route.heading == pytest.approx(-np.pi / 4)
    x, y = route.place(route.start)
    assert (x, y) == (pytest.approx(-2.0), pytest.approx(0.5))


def test_a_surface_without_course_is_crossed_along_its_longer_side():
    ramps = Arena.from_course(Course(pit=0.0))
    bare = Arena("bare", ramps.pieces, ramps.surface, ramps.quality)
    route = find_route(bare, snake(4))
    assert route.heading == 0.0
    assert -3.3 < route.start < -2.0
    assert 2.0 < route.finish < 3.3
    assert route.pit is None


def test_the_pit_of_a_surface_without_course_is_the_finish(truth):
    bare = Arena("bare", truth.pieces, truth.surface, truth.quality)
    for start in ("floor", "pit"):
        route, known = (find_route(arena, snake(4), start) for arena in (bare, truth))
        found = (route.heading, route.lateral, route.start, route.finish, route.lowest, *route.pit)
        exact = (known.heading, known.lateral, known.start, known.finish, known.lowest, *known.pit)
        assert found == pytest.approx(exact, abs=1e-3)
        assert route.half_width == pytest.approx(known.half_width, abs=0.011)


@pytest.mark.parametrize("pit", [0.45])
@pytest.mark.parametrize("name", ["gsrm", "gg"])
def test_the_route_of_a_scan_is_nearly_that_of_the_truth(name, pit):
    scanned, truth = (load_arena(one, Course(pit=pit)) for one in (name, "truth"))
    assert scanned.course is None
    for start in ("floor", "pit"):
        route, known = (find_route(arena, snake(8), start) for arena in (scanned, truth))
        assert (route.start, route.finish) == pytest.approx((known.start, known.finish), abs=0.005)
        assert route.pit == pytest.approx(known.pit, abs=0.005)
        assert route.half_width == pytest.approx(known.half_width, abs=0.03)
        assert (route.heading, route.lateral) == (0.0, 0.0)


def test_a_pit_on_a_given_way_is_its_finish(truth):
    bare = Arena("bare", truth.pieces, truth.surface, truth.quality)
    route = find_route(bare, snake(3), start=(-1.2, 0.3))
    near, far, _ = route.pit
    assert near * np.cos(route.heading) - route.lateral * np.sin(route.heading) == pytest.approx(
        -0.225, abs=0.01
    )
    assert route.finish == pytest.approx(far + 0.0627)
    beyond = find_route(bare, snake(3), start=(0.5, 0.3))
    assert beyond.pit is None


def test_a_surface_without_a_ramp_is_crossed_from_its_rim():
    ground = np.array([[-2.0, 0.25], [-0.2, 0.25], [-0.2, 0.0], [0.2, 0.0], [0.2, 0.25], [2.0, 0.25]])
    points = np.concatenate([np.insert(ground, 1, y, axis=1) for y in (-1.0, 1.0)])
    faces = [face for i in range(5) for face in ([i, i + 1, i + 7], [i, i + 7, i + 6])]
    arena = make_bare(trimesh.Trimesh(points, faces, process=False))
    route = find_route(arena, snake(4))
    assert route.start == pytest.approx(-2.0 + 3 * 0.1254 + 0.25, abs=0.011)
    with pytest.raises(ArenaError, match=r"to start before \(no gap on the way"):
        find_route(make_bare(Course(pit=0.0).surface()), snake(3), start="pit")


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


def test_stairs_have_no_pit():
    stairs = Arena.from_course(StairsCourse(), "stairs")
    with pytest.raises(ArenaError, match="no pit"):
        find_route(stairs, snake(3), start="pit")


def test_the_pit_of_a_ready_arena_cannot_be_resized(truth):
    with pytest.raises(ArenaError, match=r"cannot be set to 0\.3"):
        World(EnvironmentConfig(arena=truth, pit=0.3))


@pytest.mark.parametrize("start", ["floor", "pit", (-1.2, 0.3)])
def test_a_body_is_laid_down_on_the_ground(start):
    goal = (2.0, 0.0) if isinstance(start, tuple) else None
    world = World(EnvironmentConfig(modules=6, start=start, goal=goal))
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.lay_down(offset=0.03, yaw=0.05)
    world.write_control(data.ctrl[None], data.qpos[None, world.hinge_qpos], np.zeros((1, 1)))
    mujoco.mj_forward(world.model, data)
    assert min((contact.dist for contact in data.contact), default=0.0) > -0.004
    mujoco.mj_step(world.model, data, nstep=60)
    centers = data.xpos[world.modules]
    ground = world.arena.height(centers[:, 0], centers[:, 1])
    assert (centers[:, 2] - ground < 0.075).all()
