"""Where a body starts, which way it goes, and where it has arrived."""

import mujoco
import numpy as np
import pytest

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course, StairsCourse
from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.environment.world import World
from symbrion_gym.errors import ArenaError
from symbrion_gym.robot.organism import snake
from symbrion_gym.tasks.route import RouteMargins, find_route


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
    route = find_route(bare, snake(4))
    assert -3.3 < route.start < -2.0
    assert 0.225 < route.finish < 0.325


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
        World(SnakePitConfig(arena=truth, pit=0.3))


@pytest.mark.parametrize("start", ["floor", "pit", (-1.2, 0.3)])
def test_a_body_is_laid_down_on_the_ground(start):
    goal = (2.0, 0.0) if isinstance(start, tuple) else None
    world = World(SnakePitConfig(modules=6, start=start, goal=goal))
    data = mujoco.MjData(world.model)
    data.qpos[:] = world.lay_down(offset=0.03, yaw=0.05)
    world.write_control(data.ctrl[None], data.qpos[None, world.hinge_qpos], np.zeros((1, 1)))
    mujoco.mj_forward(world.model, data)
    assert min((contact.dist for contact in data.contact), default=0.0) > -0.004
    mujoco.mj_step(world.model, data, nstep=60)
    centers = data.xpos[world.modules]
    ground = world.arena.height(centers[:, 0], centers[:, 1])
    assert (centers[:, 2] - ground < 0.075).all()
