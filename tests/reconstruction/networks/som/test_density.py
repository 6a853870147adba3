"""Spacing of samples, and what belongs to no surface."""

import numpy as np
from scipy.spatial import cKDTree
from shapes import make_sheet

from reconstruction._src.networks.som.density import Density, find_outliers, measure_density


def _measure(points: np.ndarray) -> Density:
    return measure_density(points, cKDTree(points), np.random.default_rng(0))


def test_an_even_cloud_has_one_spacing() -> None:
    points = make_sheet(10000)
    density = _measure(points)
    assert len(np.unique(density.spacing)) == 1
    assert (density.weights == 1).all()
    assert 0.8 < density.spacing[0] / np.sqrt(2.2 / 10000) < 1.3


def test_outliers_weigh_nothing() -> None:
    points = make_sheet(10000)
    outliers = np.random.default_rng(1).uniform([-1, -0.5, 0.4], [1, 0.5, 1.5], size=(400, 3))
    weights = _measure(np.concatenate([points, outliers])).weights
    assert (weights[:10000] == 0).mean() < 0.001
    assert (weights[10000:] == 0).mean() > 0.9


def test_sparse_samples_weigh_more() -> None:
    points = make_sheet(20000)
    keep = (points[:, 0] < 0) | (np.arange(20000) % 20 == 0)
    points = points[keep]
    density = _measure(points)
    left, right = points[:, 0] < -0.2, points[:, 0] > 0.2
    assert 3.5 < np.median(density.spacing[right]) / np.median(density.spacing[left]) < 5.5
    assert np.median(density.weights[right]) > 4 * np.median(density.weights[left])
    assert (density.weights > 0).mean() > 0.99


def test_scan_lines_thicker_than_their_points_are_apart_are_seen_among_fewer() -> None:
    rng = np.random.default_rng(5)
    lines = np.column_stack([rng.random(20000), 0.1 * rng.integers(0, 11, 20000), np.zeros(20000)])
    spacing = _measure(lines + rng.normal(0, 0.002, lines.shape)).spacing
    assert np.median(spacing) > 0.03


def test_what_stands_off_a_sparse_surface_is_an_outlier() -> None:
    rng = np.random.default_rng(3)
    sheet = np.column_stack([rng.random((4000, 2)), rng.normal(0, 0.002, 4000)])
    corner = np.column_stack([np.zeros(2000), rng.random((2000, 2))])
    aloft = np.column_stack([rng.uniform(0.1, 0.9, (60, 2)), rng.uniform(0.05, 0.1, 60)])
    is_outlier = find_outliers(np.concatenate([sheet, corner, aloft]))
    assert is_outlier[-60:].mean() > 0.9
    assert is_outlier[:-60].mean() < 0.002


def test_samples_on_lines_far_apart_are_as_sparse_as_their_lines() -> None:
    rng = np.random.default_rng(4)
    lines = np.column_stack([rng.random(6000), 0.1 * rng.integers(0, 11, 6000), np.zeros(6000)])
    spacing = _measure(lines + rng.normal(0, 0.001, lines.shape)).spacing
    assert 0.03 < np.median(spacing) < 0.3  # 0.002 along the lines, 0.1 across
