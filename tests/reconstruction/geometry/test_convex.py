"""Convex solids, outlines, rectangles and boxes."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.halfspaces import (
    find_box,
    find_smallest_rectangle,
    find_tight_rectangles,
    make_prism,
    make_solid,
)
from reconstruction._src.geometry.outlines import (
    compute_bounds,
    compute_hull_outline,
    find_largest_rectangle,
    find_outline,
    is_within,
    measure_area,
)
from reconstruction._src.geometry.rows import make_hull

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def turn(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def test_the_hull_of_a_box_is_the_box_and_flat_points_have_none():
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    hull = make_hull(np.concatenate([box.vertices, np.zeros((5, 3))]))
    assert hull is not None
    assert hull.is_watertight
    assert hull.volume == pytest.approx(6.0)
    assert make_hull(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])) is None


def test_a_prism_under_a_ridge():
    tops = np.array([[-1.0, 0.0, 1.0, -1.0], [1.0, 0.0, 1.0, -3.0]])  # z <= 1 + x and z <= 3 - x
    prism = make_prism(compute_bounds(SQUARE), tops, 0.0)
    assert prism is not None
    assert prism.volume == pytest.approx(2.0 * 3.0)
    np.testing.assert_allclose(prism.bounds, [[0, 0, 0], [2, 2, 2]], atol=1e-6)
    assert make_prism(compute_bounds(SQUARE), tops, 2.5) is None
    assert make_solid(np.zeros((4, 4)), None) is None


def test_outlines_are_measured():
    assert measure_area(SQUARE) == pytest.approx(4.0)
    assert measure_area(SQUARE[::-1]) == pytest.approx(-4.0)
    assert is_within(SQUARE, np.array([[1.0, 1.0], [3.0, 1.0]])).tolist() == [True, False]
    box = trimesh.creation.box((2.0, 2.0, 1.0))
    outline = find_outline(box, np.array([[1.0, 0.0, 0.0]]))
    assert outline is not None
    assert measure_area(outline) == pytest.approx(2.0)


def test_an_outline_has_few_corners():
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    outline = compute_hull_outline(np.column_stack([np.cos(angle), np.sin(angle)]))
    assert outline is not None
    assert len(outline) <= 24
    assert measure_area(outline) == pytest.approx(np.pi, rel=0.02)
    assert compute_hull_outline(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])) is None


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2])
def test_the_smallest_rectangle_of_a_turned_one(angle):
    points = turn(np.random.default_rng(0).uniform([-2, -1], [2, 1], (4000, 2)), angle)
    found = find_smallest_rectangle(points, 0.0)
    assert found is not None
    assert np.sort(found.high - found.low) == pytest.approx([2, 4], rel=0.01)
    trimmed = find_smallest_rectangle(points, 5.0)
    assert trimmed is not None
    assert np.sort(trimmed.high - trimmed.low) == pytest.approx([1.8, 3.6], rel=0.02)
    assert find_smallest_rectangle(np.zeros((5, 2)), 0.0) is None


def test_a_tight_rectangle_leaves_a_bevelled_corner_out():
    bevelled = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.9], [1.9, 1.0], [0.0, 1.0]])
    sizes = [rectangle.high - rectangle.low for rectangle in find_tight_rectangles(bevelled)]
    assert any(np.allclose(np.sort(size), [1.0, 2.0]) for size in sizes)


def test_a_box_is_recognized_in_any_pose():
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    box.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [0.5, 0.1, 0.0]))
    found = find_box(box)
    assert found is not None
    np.testing.assert_allclose(found.half_sizes, [0.5, 1.0, 1.5])
    np.testing.assert_allclose(found.center, box.center_mass)
    assert np.linalg.det(found.axes) == pytest.approx(1.0)
    assert find_box(trimesh.creation.icosahedron()) is None
    bent = trimesh.Trimesh(np.array(box.vertices) + 1e-3 * np.eye(8, 3), box.faces, process=False)
    assert find_box(bent) is None


def test_the_largest_rectangle_of_free_cells():
    grid = np.array([[1, 1, 0, 1], [1, 1, 1, 1], [1, 1, 1, 0]], dtype=bool)
    assert find_largest_rectangle(grid) in ((0, 0, 3, 2), (1, 0, 3, 3))
    assert find_largest_rectangle(np.zeros((2, 2), dtype=bool)) == (0, 0, 0, 0)
