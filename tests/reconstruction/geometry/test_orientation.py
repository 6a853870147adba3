"""Closed parts look inwards where the scanner stood in them, and outwards elsewhere."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.orientation import looks_down_below, orient_outwards, orient_to_viewpoints


def find_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(trimesh.Trimesh(vertices, faces, process=False).volume)


@pytest.mark.parametrize("is_inverted", [False, True])
@pytest.mark.parametrize(
    ("viewpoints", "sign"),
    [
        ([0.0, 0.0, 0.4], -1),
        ([0.0, 0.0, 3.0], 1),
        ([[5.0, 0.0, 0.0], [0.0, -5.0, 0.0]], 1),
        ([[5.0, 0.0, 0.0], [0.2, 0.1, 0.0]], -1),
        (None, 1),
    ],
)
def test_a_box_looks_to_the_scanner_in_it_and_else_outwards(viewpoints, sign, is_inverted):
    box = trimesh.creation.box([2.0, 1.0, 1.0])
    if is_inverted:
        box.invert()
    views = None if viewpoints is None else np.array(viewpoints)
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    assert find_volume(vertices, orient_outwards(vertices, faces, views)) == pytest.approx(2.0 * sign)


def test_a_room_with_a_door_still_surrounds_the_scanner():
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide().subdivide()
    middle = room.triangles_center
    is_door = (middle[:, 0] > 1.99) & (np.abs(middle[:, 1]) < 0.8) & (middle[:, 2] < 0.0)
    room.update_faces(~is_door)
    vertices, faces = np.asarray(room.vertices), np.asarray(room.faces)
    turned = orient_outwards(vertices, faces, np.array([1.5, 0.0, 0.0]))
    corners = vertices[turned]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((corners.mean(axis=1) * normal).sum(axis=1) < 0).all()


def test_a_sheet_looks_to_the_nearest_scanner_and_else_up():
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    faces = np.array([[0, 1, 2]])
    below = orient_outwards(vertices, faces, np.array([[0.2, 0.2, -1.0], [0.2, 0.2, 9.0]]))
    assert below.tolist() == [[2, 1, 0]]
    assert orient_outwards(vertices, below, None).tolist() == [[0, 1, 2]]


def test_a_room_from_outside_looks_down_below_and_terrain_does_not():
    box = trimesh.creation.box([4.0, 3.0, 2.5])
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    assert looks_down_below(vertices, faces)
    assert not looks_down_below(vertices, faces[:, ::-1])
    ground = trimesh.creation.box([4.0, 3.0, 0.2])
    top = ground.triangles_center[:, 2] > 0.0
    assert not looks_down_below(np.asarray(ground.vertices), np.asarray(ground.faces)[top])
    assert not looks_down_below(np.eye(3), np.array([[0, 1, 2]]))
    assert not looks_down_below(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))


def test_a_large_face_outvotes_slivers():
    vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [2, -0.05, 0], [-0.05, 2, 0], [2.05, 2.05, 0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4], [2, 1, 5]])
    viewpoints = np.array([[1.0, 1.0, 5.0], [1.0, 1.0, -5.0]])
    middle = vertices[faces].mean(axis=1)
    turned, _ = orient_to_viewpoints(vertices, faces, middle, viewpoints, np.array([0, 1, 1, 1]))
    a, b, c = (turned.vertices[turned.faces[0, k]] for k in range(3))
    assert np.cross(b - a, c - a)[2] > 0
