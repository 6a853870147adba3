"""Tile search finds what a k-d tree finds."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from reconstruction._src.networks.som.winners import make_tiles, search_all


def find_winners(samples: np.ndarray, units: np.ndarray, k: int) -> np.ndarray:
    origin = units.mean(axis=0)
    tiles = make_tiles(samples - origin)
    winners = np.empty((len(samples), k), dtype=np.int32)
    winners[tiles.order.ravel()] = search_all(tiles, units - origin, k).reshape(-1, k)
    return winners


def _distances(samples: np.ndarray, units: np.ndarray, winners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(samples[:, None] - units[winners], axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize("num_samples", [1, 65, 5000])
@pytest.mark.parametrize("num_units", [3, 700])
@pytest.mark.parametrize("k", [1, 3])
def test_agrees_with_a_tree(num_samples: int, num_units: int, k: int) -> None:
    rng = np.random.default_rng(num_samples + num_units)
    samples = rng.normal(size=(num_samples, 3)) * [5.0, 1.0, 0.1] + 100.0
    units = rng.normal(size=(num_units, 3)) * [5.0, 1.0, 0.1] + 100.0
    expected, _ = cKDTree(units).query(samples, k=k)
    winners = find_winners(samples, units, k)
    np.testing.assert_allclose(
        _distances(samples, units, winners), expected.reshape(num_samples, k), rtol=1e-4, atol=1e-5
    )
    assert all(len(set(row)) == k for row in winners.tolist())


def test_outliers_and_duplicates_find_their_winner() -> None:
    rng = np.random.default_rng(0)
    samples = np.concatenate([rng.normal(size=(500, 3)), np.zeros((300, 3)), 1e3 * rng.normal(size=(20, 3))])
    units = samples[::3]
    expected, _ = cKDTree(units).query(samples, k=2)
    np.testing.assert_allclose(
        _distances(samples, units, find_winners(samples, units, 2)), expected, rtol=1e-3, atol=1e-3
    )


def test_tiles_hold_every_sample_once() -> None:
    samples = np.random.default_rng(1).normal(size=(1000, 3))
    tiles = make_tiles(samples)
    assert sorted(tiles.order[tiles.is_real].tolist()) == list(range(1000))
    np.testing.assert_array_equal(tiles.samples, samples.astype(np.float32)[tiles.order])


def test_tiles_hold_neighbors_alone_where_coordinates_repeat() -> None:
    """Scans are full of equal coordinates, and padding repeats samples: no tile may hold a stray one."""
    places = np.arange(70.0)
    lattice = np.stack(np.meshgrid(places, places, [0.0]), axis=-1).reshape(-1, 3)
    tiles = make_tiles(np.random.default_rng(0).permutation(lattice))
    assert np.ptp(tiles.samples, axis=1).max() <= 2 * np.sqrt(tiles.samples.shape[1])
