"""OBJ: one object a piece, read by trimesh."""

import numpy as np
import pytest
import trimesh
from exported import make_mixed_arena


def test_objects_are_the_pieces(tmp_path):
    arena = make_mixed_arena()
    arena.export(tmp_path, "obj", max_vertices=None)
    scene = trimesh.load_scene(tmp_path / "contact.obj", split_objects=True, process=False)
    assert len(scene.geometry) == 4
    for i, piece in enumerate(arena.pieces):
        found = scene.geometry[f"arena_piece_{i:03d}"]
        assert found.volume == pytest.approx(piece.volume, rel=1e-5)
        assert np.allclose(found.bounds, piece.bounds, atol=1e-6)


def test_the_surface_is_exact_to_a_micrometer(tmp_path):
    arena = make_mixed_arena()
    arena.export(tmp_path, "obj")
    surface = trimesh.load_mesh(tmp_path / "surface.obj", process=False)
    assert np.allclose(surface.vertices, arena.surface.vertices, atol=1e-6)
    assert np.array_equal(surface.faces, arena.surface.faces)
