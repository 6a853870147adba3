"""Convex patches, and how thick the solid behind them is."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.patches import compute_thickness, join_faces
from symbrion_gym._src.contact.planes import Planes
from symbrion_gym._src.contact.simplification import snap_to_planes


def make_grid(heights) -> trimesh.Trimesh:
    """Return a sheet over unit squares, its heights along x."""
    vertices = [(x, y, height) for x, height in enumerate(heights) for y in range(3)]
    corner = (np.arange(len(heights) - 1)[:, None] * 3 + np.arange(2)).reshape(-1, 1)
    faces = np.concatenate([corner + np.array(each) for each in ([0, 3, 4], [0, 4, 1])])
    return trimesh.Trimesh(np.array(vertices, float), faces, process=False)


def count_patches(mesh: trimesh.Trimesh, tolerance: float = 0.01) -> int:
    patches = join_faces(mesh, np.full(len(mesh.vertices), 0.5), tolerance)
    assert sorted(np.concatenate(patches)) == list(range(len(mesh.faces)))
    return len(patches)


def test_a_valley_is_two_and_a_plane_or_a_ridge_may_be_one():
    assert count_patches(make_grid([0.0, 0.0, 0.0, 0.0])) == 1
    assert count_patches(make_grid([0.2, 0.0, 0.2])) == 2
    assert count_patches(make_grid([0.0, 0.2, 0.0])) == 1
    assert count_patches(make_grid([0.005, 0.0, 0.005])) == 1  # within the tolerance


def test_an_outline_with_a_notch_is_no_patch():
    mesh = make_grid([0.0, 0.0, 0.0])
    mesh.update_faces(np.arange(len(mesh.faces)) != 0)
    assert count_patches(mesh) > 1


def test_thickness_ends_at_the_other_side_of_a_wall():
    wall, block = trimesh.creation.box([2.0, 0.02, 1.0]), trimesh.creation.box([2.0, 2.0, 1.0])
    on_wall, on_block = (
        compute_thickness(each, 2.0, lambda places: places[:, 0] > 9.0) for each in (wall, block)
    )
    assert on_wall.max() < 0.02
    assert on_block == pytest.approx(np.full(8, 0.03))


def test_a_valley_of_two_triangles_is_not_bridged():
    """All four vertices are corners of the hull: only the middle of the common edge tells."""
    corners = [[0, -1, 0.2], [1, 0, 0], [0, 1, 0.2], [-1, 0, 0]]
    valley = trimesh.Trimesh(corners, [[1, 2, 3], [1, 3, 0]], process=False)
    assert count_patches(valley) == 2


def test_vertices_that_planes_would_move_far_stay():
    sheet = make_grid([0.0, 0.0, 0.0])
    normals, labels = np.array([[0.0, 0.0, 1.0], [0.0, 0.02, 0.9998]]), np.array([0, 0, 1, 1, 0, 0, 1, 1])
    planes = Planes(normals, np.array([0.0, 0.001]), labels, 0.0)
    moved = snap_to_planes(sheet, planes, tolerance=0.01)
    steps = np.linalg.norm(moved.vertices - sheet.vertices, axis=1)
    assert steps.max() <= 0.03
