"""Seams, creases and boxes of convex pieces."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import (
    compute_halfspaces,
    compute_tops,
    find_box,
    find_inner_point,
    make_solid,
)
from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact.boxing import split_at_creases, turn_into_boxes
from symbrion_gym._src.contact.seams import mend_pieces

FLOOR = [(-3.3, -0.2), (3.3, -0.2), (3.3, 0.0), (-3.3, 0.0)]
WEDGE = [(0.2, 0.0), (0.2, 0.25), (0.7, 0.25), (1.7, 0.0)]


def extrude(*outlines) -> list[trimesh.Trimesh]:
    places = [[(x, y, z) for x, z in outline for y in (-1.0, 1.0)] for outline in outlines]
    return [hull for place in places if (hull := make_hull(np.array(place))) is not None]


def mirror(outline) -> list[tuple[float, float]]:
    return [(-x, z) for x, z in outline]


def find_change(before, after, margin: float = 0.0) -> float:
    rng = np.random.default_rng(0)
    x, y = rng.uniform([-3.29, -0.99], [3.29, 0.99], (40_000, 2)).T
    is_open = np.abs(np.abs(x) - 0.2) > margin
    gap = Elevation(*after).height(x, y) - Elevation(*before).height(x, y)
    return float(np.abs(gap[is_open]).max())


@pytest.fixture
def ground() -> Elevation:
    return Elevation(Course(pit=0.40).surface())


def test_halfspaces_give_the_solid_back():
    solid = extrude(WEDGE)[0]
    halfspaces = compute_halfspaces(solid)
    assert len(halfspaces) == 6
    inner = find_inner_point(halfspaces)
    assert inner is not None
    again = make_solid(halfspaces, inner)
    assert again is not None
    assert again.volume == pytest.approx(solid.volume, rel=1e-6)
    tops = compute_tops(halfspaces, np.array([[0.5, 0.0], [1.2, 0.0], [2.0, 0.0]]))
    np.testing.assert_allclose(tops, [0.25, 0.125, -np.inf], atol=1e-6)


def test_a_lip_at_a_crest_is_cut_off(ground):
    high = [(-0.2, -0.2), (-0.2, 0.25), (-0.72, 0.25), (-0.72, -0.2)]  # 5 mm above the ramp at its end
    ramp = [(-0.6, -0.2), (-0.6, 0.25), (-0.7, 0.25), (-1.7, 0.0), (-1.7, -0.2)]
    exact = extrude(FLOOR, WEDGE, mirror(WEDGE))
    rough = extrude(FLOOR, WEDGE, high, ramp)
    assert find_change(exact, rough) > 4e-3
    assert find_change(exact, mend_pieces(rough, ground), margin=1e-3) < 1e-3


def test_a_lip_that_carries_ground_at_its_end_stays():
    """Cut down to the floor it would be nearer to the ground for nine tenths, and lose 15 mm of it at the end."""
    outline = np.array([(-1.0, 0.0), (0.9, 0.0), (0.9, 0.015), (1.0, 0.015)])
    corners = np.array([[(x, y, z) for y in (-1.0, 1.0)] for x, z in outline]).reshape(-1, 3)
    faces = [(2 * i + a, 2 * i + b, 2 * i + c) for i in range(3) for a, b, c in ((0, 2, 1), (1, 2, 3))]
    ground = Elevation(trimesh.Trimesh(corners, faces, process=False))
    floor = [(-1.0, -0.2), (-1.0, 0.0), (0.0, 0.0), (0.0, -0.2)]
    lip = [(0.0, -0.2), (0.0, 0.02), (1.0, 0.02), (1.0, -0.2)]
    mended = mend_pieces(extrude(floor, lip), ground)
    assert mended[1].bounds[1, 2] > 0.015


def test_corners_that_nobody_needs_go(ground):
    ragged = np.array([(x, y, z) for x in (-3.3, 3.3) for y in (-1.0, 1.0) for z in (-0.2, 0.0)])
    bites = np.array([(x, y, z) for x in (-2.0, 0.0, 1.5) for y in (-1.01, 1.02) for z in (-0.2, 0.0)])
    floor = make_hull(np.concatenate([ragged, bites]))
    assert floor is not None
    assert len(floor.vertices) == 16
    mended = mend_pieces([floor, *extrude(WEDGE, mirror(WEDGE))], ground)
    assert len(mended[0].vertices) <= 10
    assert find_change([floor, *extrude(WEDGE, mirror(WEDGE))], mended) < 1e-3


def test_cut_coplanar_pieces_overlap_afterwards(ground):
    left = [(-3.3, -0.2), (-3.3, 0.0), (0.0, 0.0), (0.0, -0.2)]
    mended = mend_pieces(extrude(left, mirror(left)), Elevation(Course(height=1e-6, pit=0.0).surface()))
    assert mended[0].bounds[1, 0] > 0.02
    assert mended[1].bounds[0, 0] < -0.02


def test_a_course_becomes_boxes(ground):
    pieces = extrude(FLOOR, WEDGE, mirror(WEDGE))
    parts = split_at_creases(pieces, 16)
    assert len(parts) == 5
    boxes = turn_into_boxes(parts, ground)
    assert all(find_box(box) is not None for box in boxes)
    assert find_change(pieces, boxes, margin=2e-3) < 2e-3


def test_no_more_parts_than_wanted():
    assert len(split_at_creases(extrude(FLOOR, WEDGE, mirror(WEDGE)), 4)) == 4


def test_a_wall_is_not_left_hollow():
    """A box under a slope that ends at a wall must reach to the wall's foot, or the piece stays."""
    slope = [(0.2, 0.0), (0.2, 0.35), (1.7, 0.0)]
    course = extrude(FLOOR, slope)
    line = np.array([(-3.3, 0.0), (0.2, 0.0), (0.2, 0.35), (1.7, 0.0), (3.3, 0.0)])
    corners = np.array([[(x, y, z) for y in (-1.0, 1.0)] for x, z in line])
    faces = [(2 * i + a, 2 * i + b, 2 * i + c) for i in range(4) for a, b, c in ((0, 2, 1), (1, 2, 3))]
    ground = Elevation(trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False))
    boxes = turn_into_boxes(course, ground)
    inside = np.array([0.205, 0.0, 0.0]) + np.linspace(0.02, 0.33, 20)[:, None] * [0, 0, 1]
    levels = [(inside @ h[:, :3].T + h[:, 3]).max(axis=1) for h in (compute_halfspaces(box) for box in boxes)]
    assert np.min(levels, axis=0).max() < 1e-3
