"""Noise of a robot: estimated from its log to a few percent, or stated by its owner."""

import numpy as np
import pytest
from reconstruction._src.scans.scan_matching import fuse_odometry
from reconstruction._src.scans.smoothing import (
    UNKNOWN_SHAKE,
    UNKNOWN_SLIP,
    NoisePriors,
    estimate_shake,
    estimate_slip,
)

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.leveling import LevelingConfig, use_priors


@pytest.mark.parametrize("slip", [0.0025, 0.005, 0.01])
def test_slip_and_sway_of_a_track_are_estimated(slip):
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        way = np.linspace(0, 25, 2500)
        error = np.cumsum(slip * np.sqrt(way[1]) * rng.standard_normal(2500))
        found.append(estimate_slip(error + 0.003 * rng.standard_normal(2500), way))
    assert np.median(found, axis=0) == pytest.approx([slip, 0.003], rel=0.1)
    assert np.ptp(found, axis=0)[0] < 0.6 * slip


def test_the_sway_is_that_of_the_floor_but_for_scans_without_one():
    rng = np.random.default_rng(0)
    roll = 0.012 * rng.standard_normal(1000) + 0.02
    roll[::3] = 0.0
    roll[1::50] = 0.3
    assert estimate_shake(roll) == pytest.approx(0.012, rel=0.1)


def test_short_logs_tell_nothing():
    assert estimate_shake(np.full(99, 0.01)) == UNKNOWN_SHAKE
    assert estimate_slip(np.zeros(99), np.arange(99.0))[0] == UNKNOWN_SLIP
    assert estimate_slip(np.zeros(200), np.zeros(200))[0] == UNKNOWN_SLIP


def test_a_stated_slip_is_used():
    wheels = np.stack([np.linspace(0, 3, 300), np.zeros(300), np.zeros(300)], axis=1)
    matched = wheels + [0.004, 0.0, 0.0] * np.random.default_rng(0).standard_normal((300, 3))
    smooth = [fuse_odometry(matched, wheels, 0.004, s) for s in (0.001, 0.05)]
    rough = [np.abs(np.diff(track[:, 0], 2)).mean() for track in smooth]
    assert rough[0] < rough[1] / 2


def test_stated_priors_set_the_limits_of_leveling():
    config = use_priors(LevelingConfig(), NoisePriors(shake=np.radians(1.0), range_noise=0.02))
    assert config.max_tilt == pytest.approx(np.radians(5.5))
    assert config.tolerance == pytest.approx(0.06)
    assert use_priors(LevelingConfig(), NoisePriors()) == LevelingConfig()
    assert use_priors(LevelingConfig(), NoisePriors(shake=0.0)).max_tilt == pytest.approx(np.radians(2.0))


@pytest.mark.parametrize(
    "values", [{"slip": -1.0}, {"shake": np.nan}, {"range_noise": np.inf}, {"shake": -0.1}]
)
def test_impossible_priors_are_refused(values):
    with pytest.raises(ScanError, match=next(iter(values))):
        NoisePriors(**values)
