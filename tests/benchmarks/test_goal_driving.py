"""A simple pursuit reaches goals on flat ground, in the same way every time, and says when it falls."""

import numpy as np
import pytest

from benchmarks.material.driving_scenes import make_box, make_exact_arena
from benchmarks.material.goal_driving import drive, drive_to_goal
from benchmarks.material.pursuit import Pursuit, PursuitConfig, drive_route
from benchmarks.material.tracked_robot import TrackedRobot
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.traversability.footprint import Footprint


@pytest.fixture(scope="module")
def floor():
    plate = make_box((-2.0, -2.0, -0.1), (2.0, 2.0, 0.0))
    return make_exact_arena("floor", [plate], [plate])


@pytest.mark.parametrize("modules", [1, 2])
def test_goals_are_reached_from_random_starts(floor, modules):
    found = drive_to_goal(floor, num_starts=2, body=snake(modules))
    assert found["arrived"] == found["starts"] == 2
    assert found["left_ground"] == found["tipped_over"] == 0


def test_equal_seeds_drive_alike(floor):
    route = floor.find_route()
    first, second = (drive(floor, route, [3])[0] for _ in range(2))
    assert first.path == second.path
    assert drive(floor, route, [3], driver="idle")[0].remaining > 0.5


def test_the_robot_goes_on_with_its_other_end_where_that_is_ahead(floor):
    route = floor.find_route(start=(-1.0, 0.0), goal=(1.0, 0.0))
    driver = Pursuit(route, PursuitConfig())
    left, right = driver(np.array([-1.0, 0.0, 0.05]), np.pi, np.random.default_rng(0))
    assert left < -0.09
    assert right == pytest.approx(left)


def test_a_robot_that_falls_off_has_left_the_ground(floor):
    ground, route = floor.traversability(), floor.find_route(start=(0.0, 0.0), goal=(1.5, 0.0))
    robot = TrackedRobot(floor, snake(1))
    config = PursuitConfig(patience=20.0)
    ended = drive_route(robot, ground, route, lambda *_: (0.1, 0.1), np.pi, np.random.default_rng(0), config)
    assert ended.has_left_ground or ended.has_tipped_over
    assert not ended.has_arrived
    assert robot.half_length == pytest.approx(Footprint().length / 2)
