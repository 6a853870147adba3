"""Pieces cut at creases and turned into boxes, and those that lie beneath others."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import compute_halfspaces, find_box
from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact.boxing import drop_hidden, split_at_creases, turn_into_boxes

COURSE = Course()
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


def test_a_course_becomes_boxes(ground):
    pieces = extrude(FLOOR, WEDGE, mirror(WEDGE))
    parts = split_at_creases(pieces, 16)
    assert len(parts) == 5
    boxes = turn_into_boxes(parts, ground)
    assert all(find_box(box) is not None for box in boxes)
    assert find_change(pieces, boxes, margin=2e-3) < 2e-3
    assert len(split_at_creases(pieces, 4)) == 4  # no more than wanted


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


def drop(pieces):
    return drop_hidden(list(pieces), Elevation(COURSE.surface()))


def test_a_piece_beneath_others_is_left_out():
    pieces = COURSE.pieces()
    hidden = pieces[1].copy().apply_scale(0.5).apply_translation([0.25, 0.0, 0.0])
    assert len(drop([*pieces, hidden])) == 5
    doubled = drop([*pieces, pieces[2]])
    assert len(doubled) == 5  # of two equal ones, one is kept
    plate = [(-1.0, 0.0), (-1.0, 0.01), (1.0, 0.01), (1.0, 0.0)]
    assert len(drop(extrude(FLOOR, plate))) == 2  # a centimeter is ground
