"""Arithmetic along short rows: the same as NumPy's, to the bit."""

import numpy as np
import pytest

from reconstruction._src.geometry.rows import (
    all_corners,
    any_corner,
    compute_extent,
    compute_lengths,
    cross_rows,
    sum_rows,
)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("shape", [(1, 3), (1000, 3), (50, 7, 3)])
def test_rows_are_numpys(shape: tuple[int, ...], dtype: type) -> None:
    rng = np.random.default_rng(0)
    first, second = (rng.normal(size=(2, *shape)) * 10 ** rng.uniform(-8, 8, (2, *shape))).astype(dtype)
    np.testing.assert_array_equal(sum_rows(first * second), (first * second).sum(axis=-1))
    np.testing.assert_array_equal(compute_lengths(first), np.linalg.norm(first, axis=-1))
    np.testing.assert_array_equal(cross_rows(first, second), np.cross(first, second))
    assert cross_rows(first, second).dtype == dtype


def test_extent() -> None:
    points = np.random.default_rng(1).normal(size=(100, 3))
    low, high = compute_extent(points)
    np.testing.assert_array_equal(low, points.min(axis=0))
    np.testing.assert_array_equal(high, points.max(axis=0))


@pytest.mark.parametrize("sides", [2, 3])
def test_corners(sides: int) -> None:
    rng = np.random.default_rng(2)
    is_selected, faces = rng.random(50) < 0.4, rng.integers(0, 50, (200, sides))
    np.testing.assert_array_equal(any_corner(is_selected, faces), is_selected[faces].any(axis=1))
    np.testing.assert_array_equal(all_corners(is_selected, faces), is_selected[faces].all(axis=1))
    assert len(any_corner(is_selected, faces[:0])) == 0
