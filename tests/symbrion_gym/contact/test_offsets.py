"""Signed distances of surface and contact from each other."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.inside import compute_offsets, find_nearest, join_meshes
from symbrion_gym._src.contact.kinds import HeightField

SLAB = trimesh.creation.box(bounds=[[0, 0, -0.2], [4, 2, 0]])


UP = np.array([0.0, 0.0, 1.0])


def find_above(points: np.ndarray, contact) -> np.ndarray:
    return compute_offsets(points, np.tile(UP, (len(points), 1)), contact)


def test_offsets_from_a_slab():
    points = np.array([[1.0, 1.0, 0.03], [1.0, 1.0, -0.03], [1.0, 1.0, 0.0], [5.0, 1.0, -0.1]])
    assert find_above(points, [SLAB]) == pytest.approx([-0.03, 0.03, 0.0, -1.0])


def test_a_thin_slab_far_before_the_surface_stands_in_front_of_it():
    below = np.array([[1.0, 1.0, -0.5]])
    assert find_above(below, [SLAB]) == pytest.approx([0.3])
    assert compute_offsets(below, -UP[None], [SLAB]) == pytest.approx([-0.3])


def test_offsets_from_nothing():
    assert np.isneginf(find_above(np.zeros((2, 3)), [])).all()
    assert len(find_above(np.zeros((0, 3)), [SLAB])) == 0


def test_offsets_from_a_height_field():
    field = HeightField(np.zeros((3, 3)), np.array([0.0, 0.0]), np.array([4.0, 2.0]))
    points = np.array([[1.0, 1.0, 0.03], [1.0, 1.0, -0.03], [5.0, 1.0, 0.0]])
    assert find_above(points, field) == pytest.approx([-0.03, 0.03, -1.0])


def test_side_of_a_closed_box_beyond_its_corner():
    room = trimesh.creation.box((2, 2, 2))
    points = np.array([[0.0, 0.0, 0.9], [1.1, 1.1, 1.1], [0.95, 0.0, 0.0]])
    outwards = find_nearest(points, room)
    assert outwards.heights == pytest.approx([-0.1, 0.1 * 3**0.5, -0.05])
    assert outwards.distances == pytest.approx(np.abs(outwards.heights))
    assert outwards.normals[2] == pytest.approx([1.0, 0.0, 0.0])
    room.invert()
    assert find_nearest(points, room).heights == pytest.approx(-outwards.heights)


def test_faces_without_area_do_not_matter():
    faces = np.concatenate([[[0, 0, 1]], SLAB.faces])
    flat = trimesh.Trimesh(SLAB.vertices, faces, process=False)
    points = np.array([[0.0, 0.0, 0.5], [2.0, 1.0, -0.05]])
    assert find_nearest(points, flat).heights == pytest.approx(find_nearest(points, SLAB).heights)


def test_meshes_are_joined():
    vertices, faces = join_meshes([SLAB, SLAB])
    assert (len(vertices), len(faces)) == (16, 24)
    assert np.array_equal(faces[12:], faces[:12] + 8)
    assert [len(array) for array in join_meshes([])] == [0, 0]
