"""Parts that look away from where they were seen are cut off and turned; single faces are not."""

import numpy as np

from reconstruction._src.geometry.orientation import (
    compute_components,
    orient_to_viewpoints,
    turn_reversed_parts,
)
from reconstruction._src.surfaces.quality import count_topology


def make_sheet(count: int = 21) -> tuple[np.ndarray, np.ndarray]:
    """Return a sheet of 2 (count - 1)^2 faces in the plane z = 0, normals up."""
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    quads = corner[:, None] + [0, count, count + 1, 1]
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def test_a_part_with_votes_for_its_back_is_cut_off_and_turned():
    vertices, faces = make_sheet()
    middle = vertices[faces].mean(axis=1)
    is_back = middle[:, 0] < 0.4
    mesh = turn_reversed_parts(vertices, faces, np.where(is_back, -1.0, 1.0))
    corners = mesh.vertices[mesh.faces]
    rise = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    np.testing.assert_array_equal(rise < 0, is_back)
    np.testing.assert_array_equal(mesh.vertices[: len(vertices)], vertices)
    assert len(mesh.vertices) == len(vertices) + 21
    part = compute_components(mesh.faces, len(mesh.vertices))
    assert part.max() == 1
    np.testing.assert_array_equal(part == part[0], is_back == is_back[0])
    assert count_topology(mesh.faces, len(mesh.vertices)).is_manifold


def test_few_faces_and_faces_without_votes_stay():
    vertices, faces = make_sheet()
    shares = np.ones(len(faces))
    shares[[5, 77, 300]] = -1.0
    shares[100:200] = 0.0
    mesh = turn_reversed_parts(vertices, faces, shares)
    assert mesh.vertices is vertices
    assert mesh.faces is faces
    assert turn_reversed_parts(vertices, faces, np.ones(len(faces))).faces is faces


def test_faces_without_votes_go_with_their_neighbors():
    vertices, faces = make_sheet()
    middle = vertices[faces].mean(axis=1)
    is_back = np.abs(middle[:, :2] - 0.5).max(axis=1) < 0.3
    is_unknown = np.abs(middle[:, :2] - 0.5).max(axis=1) < 0.1
    shares = np.where(is_back, -1.0, 1.0) * ~is_unknown
    mesh = turn_reversed_parts(vertices, faces, shares)
    turned = (mesh.vertices[mesh.faces[:, 0]] != vertices[faces[:, 0]]).any(axis=1)
    np.testing.assert_array_equal(turned, is_back)
    assert count_topology(mesh.faces, len(mesh.vertices)).is_manifold


def test_a_sheet_seen_from_both_sides_in_two_halves_looks_both_ways():
    vertices, faces = make_sheet()
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(0, 1, (4000, 2)), np.zeros(4000)]
    viewpoints = np.array([[0.5, 0.5, 2.0], [0.2, 0.5, -2.0]])
    mesh, share = orient_to_viewpoints(vertices, faces, points, viewpoints, (points[:, 0] < 0.4) * 1)
    corners = mesh.vertices[mesh.faces]
    rise = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    is_left = corners.mean(axis=1)[:, 0] < 0.4
    np.testing.assert_array_equal(rise < 0, is_left)
    assert share == 1.0
