"""Ways on drivable ground are proposed."""

import symbrion_gym as sg
from symbrion_gym._src.tasks.paths import propose_way


def test_a_way_is_proposed_on_one_side_of_the_stairs():
    start, goal = propose_way(sg.load_arena("stairs"), sg.snake(8))
    assert max(start[0], goal[0]) < 0.0


def test_where_too_little_can_be_driven_no_way_is_proposed():
    assert propose_way(sg.load_arena("stairs"), sg.cross(9)) is None
