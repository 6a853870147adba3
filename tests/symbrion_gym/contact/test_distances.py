"""Distances in 3-D on cases known by hand."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.distances import (
    SurfaceDistance,
    compute_depths,
    find_nearest,
    find_signed_nearest,
)


def make_floor() -> trimesh.Trimesh:
    corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def make_slab(top: float, end: float = 2.0) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[[0, 0, top - 0.1], [end, 2, top]])


@pytest.mark.parametrize(("top", "bias"), [(0.0, 0.0), (0.02, 0.02), (-0.02, -0.02)])
def test_contact_in_front_or_behind_by_two_centimeters(top, bias):
    quality = SurfaceDistance(make_floor()).measure([make_slab(top)])
    assert quality.mean == pytest.approx(abs(bias), abs=2e-3)  # near its sides a point is nearer to them
    assert quality.bias == pytest.approx(bias, abs=2e-3)
    assert quality.uncovered == 0.0
    assert quality.protrusion_p95 == pytest.approx(max(bias, 0.0), abs=1e-6)


def test_half_of_the_floor_without_contact():
    quality = SurfaceDistance(make_floor()).measure([make_slab(0.0, end=1.0)])
    assert quality.uncovered == pytest.approx(0.5 - 0.05 / 2, abs=0.01)
    assert quality.max == pytest.approx(1.0, abs=0.02)


def test_without_a_face_everything_is_infinitely_far():
    for faces in (np.zeros((0, 3), dtype=int), np.asarray(make_floor().faces)[:0]):
        distance, face, place = find_nearest(np.ones((4000, 3)), np.asarray(make_floor().vertices), faces)
        assert np.isposinf(distance).all()
        assert (face == -1).all()
        assert np.isnan(place).all()


SLAB = trimesh.creation.box(bounds=[[0, 0, -0.2], [4, 2, 0]])


def test_side_of_a_closed_box_beyond_its_corner():
    room = trimesh.creation.box((2, 2, 2))
    points = np.array([[0.0, 0.0, 0.9], [1.1, 1.1, 1.1], [0.95, 0.0, 0.0]])
    outwards = find_signed_nearest(points, room)
    assert outwards.heights == pytest.approx([-0.1, 0.1 * 3**0.5, -0.05])
    assert outwards.normals[2] == pytest.approx([1.0, 0.0, 0.0])
    room.invert()
    assert find_signed_nearest(points, room).heights == pytest.approx(-outwards.heights)


def test_faces_without_area_do_not_matter():
    faces = np.concatenate([[[0, 0, 1]], SLAB.faces])
    flat = trimesh.Trimesh(SLAB.vertices, faces, process=False)
    points = np.array([[0.0, 0.0, 0.5], [2.0, 1.0, -0.05]])
    heights = [find_signed_nearest(points, each).heights for each in (flat, SLAB)]
    assert heights[0] == pytest.approx(heights[1])


def test_depths_in_two_overlapping_boxes():
    pieces = [trimesh.creation.box(bounds=[[x, 0, 0], [x + 1, 1, 1]]) for x in (0.0, 0.5)]
    points = np.array([[0.2, 0.5, 0.5], [0.75, 0.5, 0.5], [0.9, 0.5, 0.5], [2, 0.5, 0.5], [0, 0.5, 0.5]])
    assert compute_depths(points, pieces) == pytest.approx([0.2, 0.25, 0.4, 0.0, 0.0])
    assert len(compute_depths(points[:0], pieces)) == 0


def test_nothing_is_infinitely_far():
    assert np.isinf(SurfaceDistance(make_floor()).measure([]).mean)
