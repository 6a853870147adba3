"""Courses known exactly."""

import numpy as np
import pytest

from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.arenas.course import Course, StairsCourse, make_course, make_simple_surface
from symbrion_gym._src.errors import ArenaError


@pytest.mark.parametrize(
    "course", [Course(), Course(pit=0.2), Course(pit=0.0), Course(height=0.1), StairsCourse()]
)
def test_pieces_have_the_surface_as_their_top(course):
    surface, pieces = course.surface(), course.pieces()
    low, high = surface.bounds
    points = np.random.default_rng(0).uniform(low[:2] + 1e-3, high[:2] - 1e-3, size=(2000, 2))
    wanted, touched = (Elevation(*m).height(*points.T) for m in ([surface], pieces))
    assert np.isfinite(wanted).all()
    np.testing.assert_allclose(touched, wanted, atol=1e-9)
    assert all(piece.is_watertight and piece.is_convex for piece in pieces)


def test_default_course_has_the_sizes_of_the_design():
    course = Course()
    assert course.length == pytest.approx(6.65)
    assert course.pit_edges == (-0.225, 0.225)
    heights = Elevation(course.surface()).height(np.array([-2.5, -1.225, -0.5, 0.0, 0.5, 2.5]), 0.3)
    np.testing.assert_allclose(heights, [0.0, 0.125, 0.25, 0.0, 0.25, 0.0], atol=1e-12)


def test_simple_model_has_about_39_triangles_and_the_same_heights():
    course = Course()
    simple = make_simple_surface(course)
    assert len(simple.faces) == 38
    x = np.linspace(-3.2, 3.2, 101)
    wanted = Elevation(course.surface()).height(x, 0.1)
    np.testing.assert_allclose(Elevation(simple).height(x, 0.1), wanted, atol=1e-12)


@pytest.mark.parametrize("course", [Course(pit=0.3, friction=0.9), StairsCourse(steps=3)])
def test_a_course_survives_its_dictionary(course):
    assert make_course(course.as_dict()) == course


@pytest.mark.parametrize(
    "make", [lambda: Course(pit=-0.1), lambda: Course(width=0.0), lambda: StairsCourse(rise=-1.0)]
)
def test_refuses_impossible_sizes(make):
    with pytest.raises(ArenaError, match=r"pit|width|rise"):
        make()


def test_refuses_unknown_kinds_and_fields():
    with pytest.raises(ArenaError, match="pit, stairs"):
        make_course({"kind": "moon"})
    with pytest.raises(ArenaError, match="depth"):
        make_course({"kind": "pit", "depth": 3.0})
