"""Cells of a grid, and where vertical lines through their centers meet triangles."""

import numpy as np
import pytest

from symbrion_gym._src.traversability.grid import find_crossings, make_grid


def make_square_grid(cells: int = 10):
    return make_grid(np.zeros(2), np.ones(2), 1.0 / cells, 1_000_000)


def test_cells_and_centers_are_inverse():
    grid = make_square_grid()
    cells = np.arange(grid.num_cells)
    assert np.array_equal(grid.compute_cells(grid.compute_centers(cells)), cells)
    assert grid.compute_cells(np.array([[-0.01, 0.5], [0.5, 1.01], [np.nan, 0.0]])).tolist() == [-1, -1, -1]
    assert grid.find_neighbors(np.array([0, 99]), 1, 1).tolist() == [11, -1]
    assert grid.find_neighbors(np.array([0, 99]), -1, 0).tolist() == [-1, 89]


def test_a_grid_has_no_more_cells_than_allowed():
    grid = make_grid(np.zeros(2), np.array([100.0, 50.0]), 0.05, 10_000)
    assert grid.num_cells == pytest.approx(10_000, rel=0.05)
    assert grid.cell == pytest.approx(np.sqrt(0.5))


def test_a_square_of_two_triangles_is_met_once_everywhere():
    grid = make_square_grid()
    low, right, high, left = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]], dtype=float)
    found = find_crossings(grid, np.array([[low, right, high], [low, high, left]]))
    assert set(found.cell.tolist()) == set(range(grid.num_cells))
    assert found.height == pytest.approx(grid.compute_centers(found.cell)[:, 0])


def test_vertical_triangles_are_met_by_no_line_and_small_gaps_are_closed():
    grid = make_square_grid()
    wall = np.array([[[0.05, 0, 0], [0.05, 1, 0], [0.05, 1, 1]]], dtype=float)
    assert not len(find_crossings(grid, wall).cell)
    beside = np.array([[[0.051, 0, 0.3], [0.08, 0, 0.3], [0.051, 1, 0.3]]])
    assert not len(find_crossings(grid, beside).cell)
    assert len(find_crossings(grid, beside, margin=0.002).cell)


def test_heights_agree_with_trimesh_on_random_triangles():
    rng = np.random.default_rng(0)
    corners = rng.random((40, 3, 3))
    grid = make_square_grid(20)
    found = find_crossings(grid, corners)
    assert len(found.cell) > 100
    centers = grid.compute_centers(found.cell)
    for triangle, center, height in zip(found.triangle, centers, found.height, strict=True):
        weights = np.linalg.solve(np.vstack([corners[triangle, :, :2].T, np.ones(3)]), [*center, 1.0])
        assert weights.min() > -1e-6
        assert height == pytest.approx(weights @ corners[triangle, :, 2], abs=1e-9)
