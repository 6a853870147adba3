"""A scanned pit is found by itself, and a way without a pit has none."""

from dataclasses import replace

import numpy as np
import pytest

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course, StairsCourse
from symbrion_gym.arenas.loading import load_arena
from symbrion_gym.environment.snake_pit import SnakePitEnv
from symbrion_gym.errors import ArenaError
from symbrion_gym.tasks.pit_search import find_pit

ALONG = np.array([1.0, 0.0])


@pytest.mark.parametrize("width", [0.2, 0.3, 0.4, 0.45])
def test_the_pit_of_a_course_is_found(width: float) -> None:
    arena = Arena.from_course(Course(pit=width))
    found = find_pit(arena, np.array([-2.0, 0.0]), ALONG, 4.0)
    assert found is not None
    near, far, floor = found
    assert near - 2.0 == pytest.approx(-width / 2, abs=0.015)
    assert far - 2.0 == pytest.approx(width / 2, abs=0.015)
    assert floor == pytest.approx(0.0, abs=0.001)


@pytest.mark.parametrize("pit", [0.45, 0.40])
@pytest.mark.parametrize("name", ["gsrm", "gg"])
def test_the_pit_of_a_scan_is_found(name: str, pit: float) -> None:
    found = find_pit(load_arena(name, Course(pit=pit)), np.array([-2.0, 0.0]), ALONG, 4.0)
    assert found is not None
    np.testing.assert_allclose(np.array(found[:2]) - 2.0, [-pit / 2, pit / 2], atol=0.03)


@pytest.mark.parametrize("course", [Course(pit=0.0), StairsCourse()])
def test_ramps_and_stairs_are_no_pit(course: Course | StairsCourse) -> None:
    assert find_pit(Arena.from_course(course), np.array([-1.0, 0.0]), ALONG, 3.0) is None


def test_an_arena_that_knows_no_course_has_nearly_the_same_route() -> None:
    known = load_arena("gsrm")
    environments = [
        SnakePitEnv(arena=arena, start="pit", modules=4) for arena in (known, replace(known, course=None))
    ]
    routes = [environment.world.route for environment in environments]
    assert routes[1].start == pytest.approx(routes[0].start, abs=0.03)
    assert routes[1].finish == pytest.approx(routes[0].finish, abs=0.03)


def test_a_way_without_a_pit_refuses_to_start_before_one() -> None:
    arena = replace(Arena.from_course(Course(pit=0.0)), course=None)
    with pytest.raises(ArenaError, match="no known pit"):
        SnakePitEnv(arena=arena, start="pit", modules=4)
