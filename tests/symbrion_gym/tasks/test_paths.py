"""Ways that leave drivable ground are found, and others proposed on it."""

import pytest

import symbrion_gym as sg
from symbrion_gym._src.tasks.paths import find_broken_traverse, propose_way


def find(arena, modules=8, **options):
    return find_broken_traverse(sg.load_arena(arena), sg.snake(1), sg.snake(modules), **options)


def test_stairs_break_the_way_and_the_way_below_them_is_proposed():
    way = find("stairs")
    assert way is not None
    assert way.start[0] < 0.0 < way.finish[0]
    start, goal = way.other
    assert find("stairs", start=start, goal=goal) is None
    assert max(start[0], goal[0]) < 0.0
    assert propose_way(sg.load_arena("stairs"), sg.snake(8)) == way.other


@pytest.mark.parametrize("arena", ["truth", "gsrm", "gg"])
def test_a_way_that_ends_before_a_pit_is_whole(arena):
    assert find(arena) is None


def test_a_goal_beyond_the_pit_breaks_the_way():
    assert find("gsrm", start=(-0.9, 0.0), goal=(-0.5, 0.0)) is None
    assert find("gsrm", start=(-0.9, 0.0), goal=(0.9, 0.0)) is not None


def test_where_too_little_can_be_driven_no_way_is_proposed():
    assert propose_way(sg.load_arena("stairs"), sg.cross(9)) is None


def test_a_start_off_the_surface_is_refused():
    with pytest.raises(sg.ArenaError, match="start"):
        find("stairs", start=(50.0, 0.0), goal=(0.0, 0.0))
