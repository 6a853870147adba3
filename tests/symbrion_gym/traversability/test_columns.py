"""What is solid above each cell, and the walls between."""

import numpy as np
import pytest

from benchmarks.material.driving_scenes import make_box
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.traversability.columns import SortedHeights, find_spans, find_walls
from symbrion_gym._src.traversability.grid import make_grid

GRID = make_grid(np.zeros(2), np.ones(2), 0.1, 10_000)
MIDDLE = int(GRID.compute_cells(np.array([[0.55, 0.55]]))[0])


def test_solids_that_touch_are_one_span_and_others_have_a_clearance():
    floor, step = make_box((0, 0, -0.1), (1, 1, 0)), make_box((0.5, 0, 0.0005), (1, 1, 0.2))
    roof = make_box((0, 0, 1.0), (1, 1, 1.1))
    spans = find_spans(GRID, [roof, step, floor], None, crack=0.002)
    here = spans.cell == MIDDLE
    assert spans.low[here] == pytest.approx([-0.1, 1.0])
    assert spans.high[here] == pytest.approx([0.2, 1.1])
    assert spans.clearance[here] == pytest.approx([0.8, np.inf])
    assert len(spans.cell) == 200


def test_a_high_solid_contains_a_lower_one_that_ends_sooner():
    spans = find_spans(
        GRID, [make_box((0, 0, 0), (1, 1, 1)), make_box((0, 0, 0.1), (1, 1, 0.2))], None, crack=0.0
    )
    assert spans.high == pytest.approx(np.ones(100))


def test_a_height_field_is_solid_below():
    field = HeightField(np.full((11, 11), 0.3), np.zeros(2), np.ones(2))
    spans = find_spans(GRID, [], field, crack=0.0)
    assert len(spans.cell) == 100
    assert spans.high == pytest.approx(np.full(100, 0.3))
    assert (spans.low < 0.3).all()


def test_a_thin_wall_between_centers_is_found_in_its_cells():
    wall = make_box((0.51, 0.0, 0.0), (0.52, 1.0, 0.5))
    assert not len(find_spans(GRID, [wall], None, crack=0.002).cell)
    walls = find_walls(GRID, [wall], np.deg2rad(50.0))
    row = GRID.compute_cells(np.array([[0.515, y] for y in np.arange(0.05, 1.0, 0.1)]))
    assert set(walls.cells.tolist()) == set(row.tolist())
    for cell in row:
        heights = walls.heights[walls.cells == cell]
        assert np.diff(np.concatenate([[0.0], heights, [0.5]])).max() < 0.06


def test_no_pieces_have_no_walls():
    assert not len(find_walls(GRID, [], 1.0).cells)
    assert not len(find_spans(GRID, [], None, 0.0).cell)


def test_sorted_heights_find_the_nearest_of_a_cell():
    heights = SortedHeights(np.array([3, 1, 1, 1]), np.array([0.0, 2.0, -1.0, 1.0]))
    found = heights.find_nearest(np.array([1, 1, 1, 2, 3, -1]), np.array([1.6, -9.0, 0.1, 0.0, 5.0, 0.0]))
    assert heights.heights[found[[0, 1, 2, 4]]].tolist() == [2.0, -1.0, 1.0, 0.0]
    assert found[[3, 5]].tolist() == [-1, -1]
    assert SortedHeights(np.zeros(0, int), np.zeros(0)).find_nearest(np.array([0]), np.zeros(1)).tolist() == [
        -1
    ]
