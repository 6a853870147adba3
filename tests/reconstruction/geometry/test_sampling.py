"""Sampled points: on the surface, even, and the same for the same generator."""

import numpy as np
import trimesh

from reconstruction._src.geometry.sampling import sample_area, sample_cells, sample_grid

LOW, HIGH = np.array([-1.0, 2.0]), np.array([1.0, 3.0])
SQUARE = trimesh.Trimesh([[0, 0, 1], [2, 0, 1], [2, 2, 1], [0, 2, 1]], [[0, 1, 2], [0, 2, 3]], process=False)


def count_in_quarters(points: np.ndarray) -> np.ndarray:
    return np.histogram2d(points[:, 0], points[:, 1], bins=2, range=[[0, 2], [0, 2]])[0]


def test_area_samples_are_even_and_on_the_surface():
    points = sample_area(np.asarray(SQUARE.vertices), np.asarray(SQUARE.faces), 4000)
    np.testing.assert_allclose(points[:, 2], 1)
    np.testing.assert_allclose(count_in_quarters(points), 1000, rtol=0.05)


def test_a_seed_and_its_generator_draw_the_same():
    arrays = np.asarray(SQUARE.vertices), np.asarray(SQUARE.faces)
    drawn = sample_area(*arrays, 10, np.random.default_rng(3))
    np.testing.assert_array_equal(drawn, sample_area(*arrays, 10, 3))
    assert (drawn != sample_area(*arrays, 10, 4)).any()


def test_cells_have_their_centers_inside():
    cells = sample_cells(LOW, HIGH, 0.5)
    assert cells.shape == (4, 2, 2)
    np.testing.assert_allclose(cells[0, 0], [-0.75, 2.25])
    np.testing.assert_allclose(cells[-1, -1], [0.75, 2.75])


def test_a_grid_reaches_its_margin():
    points = sample_grid(np.stack([LOW, HIGH]), 5, margin=0.1)
    assert points.shape == (25, 2)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [LOW - 0.1, HIGH + 0.1])
