"""Cells of a grid, the triangles above their centers, what is solid there, and the walls between."""

import numpy as np
import pytest
import trimesh

from benchmarks.material.driving_scenes import make_box
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.traversability.columns import (
    SortedHeights,
    find_crossings,
    find_spans,
    find_walls,
    make_grid,
)

GRID = make_grid(np.zeros(2), np.ones(2), 0.1, 10_000)
MIDDLE = int(GRID.compute_cells(np.array([[0.55, 0.55]]))[0])


def test_solids_that_touch_are_one_span_and_others_have_a_clearance():
    floor, step = make_box((0, 0, -0.1), (1, 1, 0)), make_box((0.5, 0, 0.0005), (1, 1, 0.2))
    roof = make_box((0, 0, 1.0), (1, 1, 1.1))
    spans = find_spans(GRID, [roof, step, floor], None)
    here = spans.cell == MIDDLE
    assert spans.low[here] == pytest.approx([-0.1, 1.0])
    assert spans.high[here] == pytest.approx([0.2, 1.1])
    assert spans.clearance[here] == pytest.approx([0.8, np.inf])
    assert len(spans.cell) == 200


def test_sides_of_pieces_do_not_rise_beside_a_seam():
    """The side of a piece is so steep that its plane is higher by centimeters beside its edge."""
    pieces = []
    for corners in ([(0, 0), (1, 0), (1, 0.99)], [(0, 0), (1, 0.99), (1, 1), (0, 1)]):
        half = np.array(corners, dtype=float)
        below = half.mean(axis=0) + 0.9999 * (half - half.mean(axis=0))
        top, bottom = (np.column_stack([part, 0.1 * part[:, 0]]) for part in (half, below))
        pieces.append(trimesh.Trimesh(np.concatenate([top, bottom - [0, 0, 0.03]])).convex_hull)
    spans = find_spans(GRID, pieces, None)
    np.testing.assert_allclose(spans.high, 0.1 * GRID.compute_centers(spans.cell)[:, 0], atol=1e-4)


def test_a_height_field_is_solid_below():
    field = HeightField(np.full((11, 11), 0.3), np.zeros(2), np.ones(2))
    spans = find_spans(GRID, [], field)
    assert len(spans.cell) == 100
    assert spans.high == pytest.approx(np.full(100, 0.3))
    assert (spans.low < 0.3).all()


def test_a_thin_wall_between_centers_is_found_in_its_cells():
    wall = make_box((0.51, 0.0, 0.0), (0.52, 1.0, 0.5))
    assert not len(find_spans(GRID, [wall], None).cell)
    walls = find_walls(GRID, [wall])
    row = GRID.compute_cells(np.array([[0.515, y] for y in np.arange(0.05, 1.0, 0.1)]))
    assert set(walls.cells.tolist()) == set(row.tolist())
    for cell in row:
        heights = walls.heights[walls.cells == cell]
        assert np.diff(np.concatenate([[0.0], heights, [0.5]])).max() < 0.06


def test_sorted_heights_find_the_nearest_of_a_cell():
    heights = SortedHeights(np.array([3, 1, 1, 1]), np.array([0.0, 2.0, -1.0, 1.0]))
    found = heights.find_nearest(np.array([1, 1, 1, 2, 3, -1]), np.array([1.6, -9.0, 0.1, 0.0, 5.0, 0.0]))
    assert heights.heights[found[[0, 1, 2, 4]]].tolist() == [2.0, -1.0, 1.0, 0.0]
    assert found[[3, 5]].tolist() == [-1, -1]
    nothing = SortedHeights(np.zeros(0, int), np.zeros(0))
    assert nothing.find_nearest(np.array([0]), np.zeros(1)).tolist() == [-1]


def make_square_grid(cells: int = 10):
    return make_grid(np.zeros(2), np.ones(2), 1.0 / cells, 1_000_000)


def test_cells_and_centers_are_inverse():
    grid = make_square_grid()
    cells = np.arange(grid.num_cells)
    assert np.array_equal(grid.compute_cells(grid.compute_centers(cells)), cells)
    assert grid.compute_cells(np.array([[-0.01, 0.5], [0.5, 1.01], [np.nan, 0.0]])).tolist() == [-1, -1, -1]
    assert grid.find_neighbors(np.array([0, 99]), 1, 1).tolist() == [11, -1]
    assert grid.find_neighbors(np.array([0, 99]), -1, 0).tolist() == [-1, 89]


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
