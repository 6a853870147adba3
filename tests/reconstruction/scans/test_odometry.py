"""Fusion with odometry: exact tracks stay, sway is smoothed, wheels are calibrated."""

import numpy as np
from constants import with_constants
from reconstruction._src.scans.scan_matching import fuse_odometry

from reconstruction._src.scans import scan_matching


def make_track(num_scans: int = 200) -> np.ndarray:
    t = np.linspace(0, 1, num_scans)
    return np.stack([2 * t - 1, 0.8 * np.sin(3 * t) - 0.8, 1.2 * np.cos(3 * t)], axis=1)


def test_fusing_halves_the_sway_and_keeps_exact_tracks():
    true = make_track()
    np.testing.assert_allclose(fuse_odometry(true, true), true, atol=1e-9)
    swaying = true + [0.004, 0.004, 0.0] * np.random.default_rng(0).standard_normal(true.shape)
    assert np.std(fuse_odometry(swaying, true) - true) < 0.5 * np.std(swaying - true)


def test_wheels_of_another_size_are_calibrated():
    true = make_track()
    steps = np.diff(true, axis=0, prepend=true[:1])
    swaying = true + [0.004, 0.004, 0.0] * np.random.default_rng(0).standard_normal(true.shape)
    for scale in (0.85, 1.15):
        counted = true[0] + np.cumsum(steps * [scale, scale, 1.0], axis=0)
        error = np.abs(fuse_odometry(swaying, counted) - true).max()
        with with_constants(scan_matching, max_scale_error=0.0):
            assert error < 0.2 * np.abs(fuse_odometry(swaying, counted) - true).max()
        np.testing.assert_allclose(fuse_odometry(true, counted), true, atol=1e-9)


def test_less_slip_trusts_the_wheels_more():
    true = make_track()
    swaying = true + [0.004, 0.004, 0.0] * np.random.default_rng(0).standard_normal(true.shape)
    errors = [np.std(fuse_odometry(swaying, true, slip=slip) - true) for slip in (0.001, 0.005, 0.5)]
    assert errors == sorted(errors)


def test_two_poses_are_returned_as_they_are():
    two = make_track(2)
    np.testing.assert_array_equal(fuse_odometry(two, two + 1), two)
