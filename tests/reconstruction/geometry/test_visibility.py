"""Which side of a surface was seen, and orientation by it."""

import numpy as np
import trimesh

from reconstruction._src.geometry.orientation import orient_to_viewpoints
from reconstruction._src.geometry.sampling import (
    choose_viewpoints,
    find_seen_sides,
    find_visible,
    sample_area,
)


def make_box(size: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """Return a box around the origin, subdivided, its normals outwards."""
    mesh = trimesh.creation.box((size, size, size)).subdivide().subdivide()
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def draw(vertices: np.ndarray, faces: np.ndarray, number: int = 4000) -> np.ndarray:
    return sample_area(vertices, faces, number)


def test_walls_of_a_room_are_seen_from_within():
    vertices, faces = make_box()
    points = draw(vertices, faces)
    inside, outside = np.array([[0.5, 0.2, 0.1]]), np.array([[3.0, 0.1, 0.2]])
    assert (find_seen_sides(vertices, faces, points, inside) == -1).all()
    assert (find_seen_sides(vertices, faces[:, ::-1], points, inside) == 1).all()
    near = points[points[:, 0] > 1.99]
    sides = find_seen_sides(vertices, faces, near, outside)
    is_near = (vertices[faces][:, :, 0] > 1.99).all(axis=1)
    assert (sides[is_near] == 1).all()
    assert (sides[~is_near] != 1).mean() > 0.8


def test_faces_without_a_vote_and_with_both_sides_seen_are_undecided():
    vertices, faces = make_box()
    points = draw(vertices, faces)
    left = points[points[:, 0] < 0.0]
    sides = find_seen_sides(vertices, faces, left, np.zeros((1, 3)))
    assert (sides[vertices[faces][:, :, 0].min(axis=1) > 0.1] == 0).all()
    wall = np.concatenate([points, points])
    seen_from = np.repeat([0, 1], len(points))
    both = np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0]])
    is_right = (vertices[faces][:, :, 0] > 1.99).all(axis=1)
    assert (find_seen_sides(vertices, faces, wall, both, seen_from)[is_right] == 0).mean() > 0.9
    assert find_seen_sides(vertices, faces[:0], points, both).shape == (0,)
    assert (find_seen_sides(vertices, faces, points[:0], both) == 0).all()


def test_of_several_viewpoints_the_nearest_that_sees_the_point_is_taken():
    wall = np.stack(np.meshgrid(0.0, np.linspace(-2, 2, 161), np.linspace(-2, 2, 161)), -1).reshape(-1, 3)
    far = np.stack(np.meshgrid(1.0, np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), -1).reshape(-1, 3)
    viewpoints = np.array([[-1.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    chosen = choose_viewpoints(np.concatenate([wall, far]), viewpoints)
    assert (chosen[: len(wall)] == 0).mean() > 0.99
    assert (chosen[len(wall) :] == 1).mean() > 0.9
    assert find_visible(np.concatenate([wall, far]), viewpoints[0])[len(wall) :].mean() < 0.1


def test_components_turn_to_where_they_were_seen_from():
    vertices, faces = make_box()
    small = 0.2 * vertices + [0.5, 0.0, 0.0]
    both = np.concatenate([vertices, small])
    joined = np.concatenate([faces, faces[:, ::-1] + len(vertices)])
    points = np.concatenate([draw(vertices, faces), draw(small, faces)[:500]])
    viewpoint = np.array([[-1.0, 0.0, 0.0]])
    is_seen = find_visible(points, viewpoint[0])
    (_, turned), share = orient_to_viewpoints(both, joined, points[is_seen], viewpoint)
    np.testing.assert_array_equal(turned[: len(faces)], faces[:, ::-1])
    np.testing.assert_array_equal(turned[len(faces) :], joined[len(faces) :, ::-1])
    assert share > 0.95


def test_a_component_without_votes_looks_to_the_nearest_viewpoint():
    vertices, faces = make_box()
    (_, turned), share = orient_to_viewpoints(vertices, faces, np.full((1, 3), 99.0), np.zeros((1, 3)))
    np.testing.assert_array_equal(turned, faces[:, ::-1])
    assert share == 1.0
    assert orient_to_viewpoints(vertices, faces[:0], np.zeros((1, 3)), np.zeros((1, 3)))[1] == 1.0
