"""What an arena is made of, and what is asked about."""

import numpy as np
import trimesh

from symbrion_gym.arenas.making import make_arena
from symbrion_gym.arenas.scanned import find_doubts, take_surface


def test_a_room_without_viewpoint_and_a_mesh_in_millimeters_are_asked_about():
    room = trimesh.creation.box([4.0, 3.0, 2.5])
    assert not find_doubts(take_surface(room))
    room.invert()
    (doubt,) = find_doubts(take_surface(room))
    assert "give viewpoints" in doubt
    assert not find_doubts(take_surface(room, [0.0, 0.0, 0.0]))
    (doubt,) = find_doubts(take_surface(trimesh.creation.box([4000.0, 3000.0, 2500.0])))
    assert "another unit" in doubt


def test_a_room_seen_from_inside_is_hollow():
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide()
    arena = make_arena(room, viewpoints=[0.0, 0.0, 0.0], cache=False)
    for piece in arena.pieces:
        assert np.abs(piece.vertices / [2.0, 1.5, 1.25]).max(axis=1).min() > 0.99
    assert arena.quality.free_space == 0.0
    assert arena.quality.beams_contact == 1.0
