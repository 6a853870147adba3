"""Scan matching: a room of known walls, a drive with drifting wheels."""

from dataclasses import replace

import numpy as np
import pytest
from reconstruction._src.scans.smoothing import NoisePriors

from reconstruction._src.base.errors import ScanError
from reconstruction._src.geometry.pose import make_pose
from reconstruction._src.scans.localization import (
    LocalizationConfig,
    estimate_pitch,
    localize,
    match_scans,
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


def test_matching_finds_the_track_that_the_wheels_lose():
    scans, true = make_drive()
    lost = measure_localization(scans.odometry, true)
    found = measure_localization(match_scans(scans), true)
    assert lost["localization_max"] > 0.03
    assert found["localization_max"] < 0.01
    assert found["localization_max_deg"] < 0.3


def test_the_sway_of_the_scanner_gives_the_pitch():
    rng = np.random.default_rng(0)
    true = np.stack([np.linspace(0, 5, 500), np.zeros(500), np.full(500, 0.5)], axis=1)
    pitch = np.radians(0.7) * rng.standard_normal(500)
    height = 0.3
    matched = true + np.outer(height * np.sin(pitch), [np.cos(0.5), np.sin(0.5), 0])
    assert np.std(estimate_pitch(matched, true, height) - pitch) < 0.15 * np.std(pitch)
    np.testing.assert_array_equal(estimate_pitch(matched, true, 0.01), 0)


def test_equal_scans_give_equal_tracks():
    scans, _ = make_drive(num_scans=25)
    np.testing.assert_array_equal(match_scans(scans), match_scans(scans))


def test_the_track_begins_at_the_start():
    scans, true = make_drive(num_scans=25)
    np.testing.assert_allclose(match_scans(scans)[0], true[0], atol=1e-9)


def test_blind_scans_follow_the_wheels():
    scans, _ = make_drive(num_scans=25)
    blind = HorizontalScans(
        np.full_like(scans.ranges, np.nan), ANGLES, np.eye(4), scans.odometry, scans.start
    )
    np.testing.assert_allclose(match_scans(blind), scans.odometry, atol=1e-6)


def test_a_log_is_localized_and_judged():
    scans, true = make_drive(num_scans=40)
    robot = make_pose(*true.T)
    log = ScanLog(
        np.ones((40, 3)),
        np.zeros(3),
        robot,
        horizontal=scans,
        truth=ScanTruth(robot, np.zeros((40, 3), bool)),
    )
    done = localize(log)
    np.testing.assert_allclose(done.poses, robot, atol=0.02)
    assert done.report["localization_max"] < 0.02


def test_the_truth_is_never_read():
    scans, true = make_drive(num_scans=25)
    wrong = ScanTruth(make_pose(*(true + 1).T), np.zeros((25, 3), bool))
    log = ScanLog(np.ones((25, 3)), np.zeros(3), make_pose(*scans.odometry.T), horizontal=scans)
    np.testing.assert_array_equal(localize(log).poses, localize(log.replace(truth=wrong)).poses)


def test_a_log_without_horizontal_scans_is_refused():
    with pytest.raises(ScanError, match="horizontal"):
        localize(ScanLog(np.ones((2, 3)), np.zeros(3), np.tile(np.eye(4), (2, 1, 1))))


def test_the_settings_are_used():
    scans, true = make_drive(num_scans=40)
    mount = np.eye(4)
    mount[2, 3] = 0.3
    raised = replace(scans, mount=mount)
    log = ScanLog(np.ones((40, 3)), np.zeros(3), make_pose(*true.T), horizontal=raised)
    poses = localize(log).poses
    for config in (
        LocalizationConfig(slip=0.05),
        LocalizationConfig(vibration=0.1),
    ):
        other = localize(log, config=config).poses
        assert 0 < np.abs(other - poses).max() < 0.2


def test_stated_priors_are_those_of_the_settings():
    scans, true = make_drive(num_scans=40)
    log = ScanLog(np.ones((40, 3)), np.zeros(3), make_pose(*true.T), horizontal=scans)
    settings = LocalizationConfig(vibration=0.02, slip=0.03)
    stated = localize(log, priors=NoisePriors(slip=0.03, shake=0.02))
    np.testing.assert_array_equal(stated.poses, localize(log, config=settings).poses)


@pytest.mark.parametrize(
    ("config", "options", "reason"),
    [
        (LocalizationConfig, {"vibration": 0.0}, "vibration must be above 0"),
        (LocalizationConfig, {"slip": -1.0}, "slip must not be negative"),
    ],
)
def test_settings_out_of_range_are_refused(config, options, reason):
    with pytest.raises(ScanError, match=reason):
        config(**options)
