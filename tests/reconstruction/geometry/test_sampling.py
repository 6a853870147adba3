"""Sampled points: on the surface, even, and the same for the same generator."""

import numpy as np
import trimesh

from reconstruction.geometry.sampling import sample_area, sample_box, sample_grid, sample_surface

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


def test_surface_samples_are_those_of_trimesh():
    points, faces = sample_surface(SQUARE, 20, np.random.default_rng(5))
    expected = trimesh.sample.sample_surface(SQUARE, 20, seed=5)
    np.testing.assert_array_equal(points, expected[0])
    np.testing.assert_array_equal(faces, expected[1])


def test_a_grid_reaches_just_beyond_its_corners():
    grid = sample_grid(np.array([[0.0, 0.0, 9.0], [1.0, 2.0, 9.0]]), 3)
    assert grid.shape == (9, 2)
    np.testing.assert_allclose([grid[0], grid[4], grid[-1]], [[-1e-3, -1e-3], [0.5, 1], [1.001, 2.001]])


def test_a_box_is_covered_evenly_without_a_generator():
    points = sample_box(np.array([[0.0, 0.0], [2.0, 2.0]]), 4000)
    np.testing.assert_allclose(count_in_quarters(points), 1000, rtol=0.01)
