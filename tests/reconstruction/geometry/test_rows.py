"""Arithmetic along short rows: the same as NumPy's, to the bit; points in boxes."""

import numpy as np
import pytest

from reconstruction._src.geometry.rows import (
    all_rows,
    any_rows,
    compute_extent,
    compute_lengths,
    cross_rows,
    find_inside,
    find_near_box,
    sum_rows,
)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("shape", [(1000, 3), (50, 7, 3)])
def test_rows_are_numpys(shape: tuple[int, ...], dtype: type) -> None:
    rng = np.random.default_rng(0)
    first, second = (rng.normal(size=(2, *shape)) * 10 ** rng.uniform(-8, 8, (2, *shape))).astype(dtype)
    np.testing.assert_array_equal(sum_rows(first * second), (first * second).sum(axis=-1))
    np.testing.assert_array_equal(compute_lengths(first), np.linalg.norm(first, axis=-1))
    np.testing.assert_array_equal(cross_rows(first, second), np.cross(first, second))
    assert cross_rows(first, second).dtype == dtype


@pytest.mark.parametrize("sides", [2, 3])
def test_rows_of_truth_values(sides: int) -> None:
    rng = np.random.default_rng(2)
    is_selected, faces = rng.random(50) < 0.4, rng.integers(0, 50, (200, sides))
    np.testing.assert_array_equal(any_rows(is_selected[faces]), is_selected[faces].any(axis=1))
    np.testing.assert_array_equal(all_rows(is_selected[faces]), is_selected[faces].all(axis=1))
    assert len(any_rows(is_selected[faces[:0]])) == 0


def test_the_points_in_a_box() -> None:
    points = np.random.default_rng(0).normal(size=(1000, 3))
    low, high = np.array([-0.5, -1.0, 0.0]), np.array([0.7, 0.2, 2.0])
    expected = ((points >= low) & (points <= high)).all(axis=1)
    np.testing.assert_array_equal(find_inside(points, low, high), np.flatnonzero(expected))
    np.testing.assert_array_equal(compute_extent(points), [points.min(axis=0), points.max(axis=0)])
    corners = np.array([[0, 0, 0], [1, 1, 1], [0.5, 0.5, 1.01], [-0.01, 0, 0], [0.5, 2, 0.5]], dtype=float)
    assert find_inside(corners, np.zeros(3), np.ones(3)).tolist() == [0, 1]  # its sides belong to it
    assert find_near_box(corners, corners[:2], 0.02).tolist() == [0, 1, 2, 3]
