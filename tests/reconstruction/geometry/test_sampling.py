"""Points over a rectangle in plan."""

import numpy as np

from reconstruction.geometry.sampling import sample_cells, sample_evenly, sample_grid

LOW, HIGH = np.array([-1.0, 2.0]), np.array([1.0, 3.0])


def test_cells_have_their_centers_inside():
    cells = sample_cells(LOW, HIGH, 0.5)
    assert cells.shape == (4, 2, 2)
    np.testing.assert_allclose(cells[0, 0], [-0.75, 2.25])
    np.testing.assert_allclose(cells[-1, -1], [0.75, 2.75])


def test_a_grid_reaches_its_margin():
    points = sample_grid(np.stack([LOW, HIGH]), 5, margin=0.1)
    assert points.shape == (25, 2)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [LOW - 0.1, HIGH + 0.1])


def test_even_points_fill_every_part_alike():
    points = sample_evenly(LOW, HIGH, 4000)
    counts, *_ = np.histogram2d(*points.T, bins=(4, 5), range=np.stack([LOW, HIGH]).T)
    assert np.abs(counts - 200).max() <= 12
