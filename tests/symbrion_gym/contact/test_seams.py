"""Creases, boxes and hidden edges of convex pieces."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import compute_halfspaces, find_box
from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact import seams
from symbrion_gym._src.contact.boxing import split_at_creases, turn_into_boxes
from symbrion_gym._src.contact.seams import clear_hidden_edges

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


def clear(pieces):
    return clear_hidden_edges(list(pieces), Elevation(COURSE.surface()))


def test_ends_at_a_crest_lie_beneath_the_other_plane_by_the_clearance_and_those_at_walls_stay():
    clearance = seams._CLEARANCE
    floor, block, ramp, *others = clear(COURSE.pieces())
    crest = COURSE.pit / 2 + COURSE.plateau
    # The ramp falls by 1 in 4: its plane is z = 0.25 - (x - crest) / 4, sideways shorter by sqrt(17) / 4.
    assert block.bounds[1, 0] == pytest.approx(crest - clearance * np.sqrt(17.0), abs=1e-5)
    assert ramp.bounds[1, 2] == pytest.approx(COURSE.height - clearance, abs=1e-5)
    assert block.bounds[0, 0] == COURSE.pit / 2
    assert np.array_equal(floor.vertices, COURSE.pieces()[0].vertices)
    assert len(others) == 2
    assert all(find_box(piece) is not None for piece in (floor, block, ramp, *others)), "boxes stay boxes"


@pytest.mark.parametrize(
    "ramp", [[(0.7, 0.25), (1.7, 0.23), (1.7, 0.0)], [(0.7, 0.245), (0.9, 0.045), (0.9, 0.0)]]
)
def test_ends_stay_where_planes_hardly_bend_and_above_a_step(ramp):
    block = [(0.2, 0.0), (0.2, 0.25), (0.7, 0.25), (0.7, 0.0)]
    assert clear(extrude(block, [(0.7, 0.0), *ramp]))[0].bounds[1, 0] == 0.7


def test_a_piece_beneath_others_is_left_out():
    pieces = COURSE.pieces()
    hidden = pieces[1].copy().apply_scale(0.5).apply_translation([0.25, 0.0, 0.0])
    assert len(clear([*pieces, hidden])) == 5
    doubled = clear([*pieces, pieces[2]])
    assert len(doubled) == 5  # of two equal ones, one is kept
    plate = [(-1.0, 0.0), (-1.0, 0.01), (1.0, 0.01), (1.0, 0.0)]
    assert len(clear(extrude(FLOOR, plate))) == 2  # a centimeter is ground


def test_the_ground_is_lowered_by_no_more_than_a_body_feels():
    pieces = COURSE.pieces()
    x = np.linspace(-3.0, 3.0, 6001)
    before, after = (Elevation(*each).height(x, 0.3) for each in (pieces, clear(pieces)))
    crest = COURSE.pit / 2 + COURSE.plateau
    is_far = np.abs(np.abs(x) - crest) > 0.005
    assert np.abs(before - after)[is_far].max() < 1e-6
