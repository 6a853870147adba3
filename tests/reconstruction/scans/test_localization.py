"""Scan matching: a room of known walls, a drive with drifting wheels; fusion with odometry."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.geometry.pose import make_pose
from reconstruction._src.scans import localization
from reconstruction._src.scans.leveling import estimate_shake
from reconstruction._src.scans.localization import (
    estimate_pitch,
    estimate_slip,
    fuse_odometry,
    localize,
    measure_localization,
)
from reconstruction._src.scans.scan import HorizontalScans, ScanLog, ScanTruth

ANGLES = np.radians(np.linspace(-90, 90, 181))
WALLS = np.array(  # a room with two niches, x0 y0 x1 y1
    [
        [-3, -2, 4, -2], [4, -2, 4, 1], [4, 1, 3, 1], [3, 1, 3, 2], [3, 2, 0, 2], [0, 2, 0, 2.6],
        [0, 2.6, -1.5, 2.6], [-1.5, 2.6, -1.5, 2], [-1.5, 2, -3, 2], [-3, 2, -3, -2],
    ]
)  # fmt: skip


def see_walls(planar: np.ndarray) -> np.ndarray:
    """Exact ranges from x, y, yaw to the nearest wall."""
    a = ANGLES + planar[2]
    direction = np.stack([np.cos(a), np.sin(a)], axis=1)[:, None]
    start, along = WALLS[:, :2] - planar[:2], WALLS[:, 2:] - WALLS[:, :2]
    cross = direction[..., 0] * along[:, 1] - direction[..., 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * direction[..., 1] - start[:, 1] * direction[..., 0]) / cross
    hit = (distance > 0) & (share >= 0) & (share <= 1)
    return np.where(hit, distance, np.inf).min(axis=1)


def make_drive(
    num_scans: int = 150, noise: float = 0.005, seed: int = 0
) -> tuple[HorizontalScans, np.ndarray]:
    """Drive a curve through the room, with wheels that count 2 % too much and turn 3 % too little."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, num_scans)
    true = np.stack([2 * t - 1, 0.8 * np.sin(3 * t) - 0.8, 1.2 * np.cos(3 * t)], axis=1)
    ranges = np.stack([see_walls(pose) for pose in true]) + noise * rng.standard_normal((num_scans, 181))
    odometry = true[0] + np.cumsum(np.diff(true, axis=0, prepend=true[:1]) * [1.02, 1.02, 0.97], axis=0)
    return HorizontalScans(ranges, ANGLES, np.eye(4), odometry, true[0]), true


def make_log(scans: HorizontalScans, true: np.ndarray | None = None) -> ScanLog:
    """A log whose vertical scans see nothing of a floor."""
    count = len(scans.ranges)
    poses = make_pose(*scans.odometry.T)
    truth = None if true is None else ScanTruth(make_pose(*true.T), np.zeros((count, 3), bool))
    return ScanLog(np.ones((count, 3)), np.zeros(3), poses, horizontal=scans, truth=truth)


def test_matching_finds_the_track_that_the_wheels_lose():
    scans, true = make_drive()
    lost = measure_localization(scans.odometry, true)
    done = localize(make_log(scans, true))
    assert lost["localization_max"] > 0.03
    assert done.report["localization_max"] < 0.01
    assert done.report["localization_max_deg"] < 0.3
    np.testing.assert_allclose(done.poses[0], make_pose(*true[0]), atol=1e-9)  # begins at the start


def test_equal_scans_give_equal_tracks_and_the_truth_is_never_read():
    scans, true = make_drive(num_scans=25)
    poses = localize(make_log(scans)).poses
    np.testing.assert_array_equal(poses, localize(make_log(scans, true + 1)).poses)


def test_blind_scans_follow_the_wheels():
    scans, _ = make_drive(num_scans=25)
    nothing = np.full_like(scans.ranges, np.nan)
    blind = HorizontalScans(nothing, ANGLES, np.eye(4), scans.odometry, scans.start)
    np.testing.assert_allclose(localize(make_log(blind)).poses, make_pose(*scans.odometry.T), atol=1e-6)


def test_a_log_without_horizontal_scans_is_refused():
    with pytest.raises(ScanError, match="horizontal"):
        localize(ScanLog(np.ones((2, 3)), np.zeros(3), np.tile(np.eye(4), (2, 1, 1))))


def test_the_sway_of_the_scanner_gives_the_pitch():
    rng = np.random.default_rng(0)
    true = np.stack([np.linspace(0, 5, 500), np.zeros(500), np.full(500, 0.5)], axis=1)
    pitch = np.radians(0.7) * rng.standard_normal(500)
    height, sway = 0.3, 0.3 * np.radians(0.7)
    matched = true + np.outer(height * np.sin(pitch), [np.cos(0.5), np.sin(0.5), 0])
    assert np.std(estimate_pitch(matched, true, height, sway) - pitch) < 0.15 * np.std(pitch)
    np.testing.assert_array_equal(estimate_pitch(matched, true, 0.01, sway), 0)


def make_track() -> tuple[np.ndarray, np.ndarray]:
    """Return true poses, and those by a scanner that sways by 4 mm."""
    t = np.linspace(0, 1, 200)
    true = np.stack([2 * t - 1, 0.8 * np.sin(3 * t) - 0.8, 1.2 * np.cos(3 * t)], axis=1)
    return true, true + [0.004, 0.004, 0.0] * np.random.default_rng(0).standard_normal(true.shape)


def test_fusing_halves_the_sway_and_keeps_exact_tracks():
    true, swaying = make_track()
    np.testing.assert_allclose(fuse_odometry(true, true, 0.004), true, atol=1e-9)
    assert np.std(fuse_odometry(swaying, true, 0.004) - true) < 0.5 * np.std(swaying - true)
    np.testing.assert_array_equal(fuse_odometry(true[:2], true[:2] + 1, 0.004), true[:2])


@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_wheels_of_another_size_are_calibrated(scale):
    true, swaying = make_track()
    steps = np.diff(true, axis=0, prepend=true[:1])
    counted = true[0] + np.cumsum(steps * [scale, scale, 1.0], axis=0)
    np.testing.assert_allclose(fuse_odometry(true, counted, 0.004), true, atol=1e-9)
    assert np.abs(fuse_odometry(swaying, counted, 0.004) - true).max() < 0.006


def test_less_slip_trusts_the_wheels_more(monkeypatch):
    true, swaying = make_track()
    errors = []
    for slip in (0.001, 0.005, 0.5):
        monkeypatch.setattr(localization, "estimate_slip", lambda error, way, slip=slip: slip)
        errors.append(np.std(fuse_odometry(swaying, true, 0.004) - true))
    assert errors == sorted(errors)


@pytest.mark.parametrize("slip", [0.0025, 0.01])
def test_the_slip_of_a_track_is_estimated(slip):
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        way = np.linspace(0, 25, 2500)
        error = np.cumsum(slip * np.sqrt(way[1]) * rng.standard_normal(2500))
        found.append(estimate_slip(error + 0.003 * rng.standard_normal(2500), way))
    assert np.median(found) == pytest.approx(slip, rel=0.1)
    assert estimate_slip(np.zeros(99), np.arange(99.0)) == 0.01, "short tracks tell nothing"


def test_the_sway_is_that_of_the_floor_but_for_scans_without_one():
    roll = 0.012 * np.random.default_rng(0).standard_normal(1000) + 0.02
    roll[::3] = 0.0
    roll[1::50] = 0.3
    assert estimate_shake(roll) == pytest.approx(0.012, rel=0.1)
    assert estimate_shake(roll[:99]) == np.radians(1.0)
