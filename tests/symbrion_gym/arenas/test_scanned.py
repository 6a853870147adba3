"""What an arena is made of, and what is asked about."""

import numpy as np
import trimesh

import reconstruction as rc
from symbrion_gym.arenas.making import make_arena
from symbrion_gym.arenas.scanned import find_doubts, find_two_sided, take_surface


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


def join(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    joined = trimesh.util.concatenate(meshes)
    assert isinstance(joined, trimesh.Trimesh)
    return joined


def test_without_viewpoints_backs_below_the_sky_were_seen():
    ground = trimesh.Trimesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]])
    leaning = trimesh.Trimesh([[0, 0, 0.5], [1, 0, 0.5], [0, 1, 1.0]], [[0, 2, 1]])
    assert leaning.face_normals[0, 2] < -0.5
    mesh = join([ground, leaning])
    found = find_two_sided(take_surface(mesh), mesh)
    assert found is not None
    assert found.tolist() == [False, False, True]
    roof = ground.copy().apply_translation([0, 0, 2])
    covered = join([ground, leaning, roof])
    found = find_two_sided(take_surface(covered), covered)
    assert found is not None
    assert not found[:3].any()


def test_a_closed_body_without_viewpoints_has_no_backs():
    box = trimesh.creation.box()
    assert find_two_sided(take_surface(box), box) is None


def test_an_arena_says_what_of_the_surface_was_cut():
    side = np.linspace(0, 3, 61)
    floor = np.stack([*np.meshgrid(side, side), np.zeros((61, 61))], axis=-1).reshape(-1, 3)
    made = rc.reconstruct(floor, units=200)
    assert "cut" not in make_arena(made, cache=False).provenance
    made.notes["cut"] = "3 m² of the surface"
    assert make_arena(made, cache=False).provenance["cut"] == "3 m² of the surface"
