"""Which ground a scanner saw, and arenas in one line."""

import numpy as np
import pytest
import trimesh

from benchmarks.material.driving_scenes import make_furnished_room, make_terrain
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.seen_places import MOST_VIEWPOINTS, SeenPlaces, choose_positions


def test_a_wall_hides_what_is_behind_it_from_one_viewpoint_but_not_from_two():
    wall = trimesh.creation.box([0.1, 4.0, 2.0])
    places = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 3.0]])
    first = SeenPlaces(wall, np.array([[-2.0, 0.0, 0.5]]))
    assert first(places).tolist() == [True, False, True]
    both = SeenPlaces(wall, np.array([[-2.0, 0.0, 0.5], [2.0, 0.0, 0.5]]))
    assert both(places).tolist() == [True, True, True]
    assert both(places[:0]).tolist() == []


def test_few_positions_are_kept():
    assert choose_positions(None) is None
    assert choose_positions(np.array([[1.23456, 0.0, 2.0]])) == [[1.235, 0.0, 2.0]]
    many = choose_positions(np.arange(3000.0).reshape(-1, 3))
    assert many is not None
    assert len(many) == MOST_VIEWPOINTS
    assert many[0] == [0.0, 1.0, 2.0]
    assert many[-1] == [2997.0, 2998.0, 2999.0]


def test_chosen_ends_were_seen():
    room = make_furnished_room()
    viewpoint = [3.4, 0.4, 0.6]  # behind the screen
    room.provenance["viewpoints"] = [viewpoint]
    seen = SeenPlaces(room.surface, np.array([viewpoint]))
    route = room.find_route()
    assert seen(np.array([route.start, route.goal])).all()
    room.provenance.pop("viewpoints")
    free = room.find_route()
    assert not seen(np.array([free.start, free.goal])).all()


@pytest.mark.parametrize(
    ("arena", "words"),
    [
        (Arena.from_course(Course()), "'truth': 5 convex pieces, 18 faces"),
        (make_terrain(0, size=2.0), "'terrain': a height field, "),
    ],
)
def test_an_arena_prints_one_line(arena, words):
    text = repr(arena)
    assert words in text
    assert "\n" not in text
    assert len(text) < 120
    assert str(arena) == text
