"""Hidden ends of pieces that bodies slide over."""

import numpy as np
import pytest

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_box
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact import crease_lines
from symbrion_gym._src.contact.crease_lines import clear_hidden_edges


@pytest.fixture(scope="module")
def course() -> Course:
    return Course()


def clear(pieces, course):
    return clear_hidden_edges(list(pieces), Elevation(course.surface()))


def test_ends_at_a_crest_lie_beneath_the_other_plane_by_the_clearance(course):
    clearance = crease_lines._CLEARANCE
    _, block, ramp, *_ = clear(course.pieces(), course)
    crest = course.pit / 2 + course.plateau
    # The ramp falls by 1 in 4: its plane is z = 0.25 - (x - crest) / 4, sideways shorter by sqrt(17) / 4.
    assert block.bounds[1, 0] == pytest.approx(crest - clearance * np.sqrt(17.0), abs=1e-5)
    assert ramp.bounds[1, 2] == pytest.approx(course.height - clearance, abs=1e-5)


def test_ends_at_walls_stay_and_boxes_stay_boxes(course):
    cleared = clear(course.pieces(), course)
    assert len(cleared) == 5
    assert all(find_box(piece) is not None for piece in cleared)
    assert cleared[1].bounds[0, 0] == course.pit / 2
    assert np.array_equal(cleared[0].vertices, course.pieces()[0].vertices)


def test_a_ramp_reaches_into_the_floor_at_its_foot(course):
    ramp = clear(course.pieces(), course)[2]
    foot = course.ramp_feet[1]
    assert Elevation(ramp).height(np.array([foot + 5e-4]), np.array([0.0]))[0] < 0.0


def test_a_piece_beneath_others_is_left_out(course):
    pieces = course.pieces()
    hidden = pieces[1].copy().apply_scale(0.5).apply_translation([0.25, 0.0, 0.0])
    assert len(clear([*pieces, hidden], course)) == 5
    doubled = clear([*pieces, pieces[2]], course)
    assert len(doubled) == 5  # of two equal ones, one is kept


def test_the_ground_is_lowered_by_no_more_than_a_body_feels(course):
    pieces = course.pieces()
    x = np.linspace(-3.0, 3.0, 6001)
    before, after = (Elevation(*each).height(x, 0.3) for each in (pieces, clear(pieces, course)))
    crest = course.pit / 2 + course.plateau
    is_far = np.abs(np.abs(x) - crest) > 0.005
    assert np.abs(before - after)[is_far].max() < 1e-6


def test_equal_pieces_give_equal_pieces(course):
    first, second = clear(course.pieces(), course), clear(course.pieces(), course)
    for mine, theirs in zip(first, second, strict=True):
        assert np.array_equal(mine.vertices, theirs.vertices)
