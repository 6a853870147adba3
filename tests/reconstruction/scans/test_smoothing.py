"""The moving average by hand, and where it stops."""

import numpy as np
import pytest
from reconstruction._src.scans.smoothing import find_creases, smooth_ranges

from reconstruction._src.scans.scan import ScanLog


def smooth(ranges: np.ndarray, **options) -> np.ndarray:
    ranges = np.atleast_2d(np.asarray(ranges, float))
    log = ScanLog(
        ranges, np.radians(0.5 * np.arange(ranges.shape[1])), np.tile(np.eye(4), (len(ranges), 1, 1))
    )
    return smooth_ranges(log, **options).ranges


def mean_by_hand(ranges: np.ndarray, beam: int, reach: int) -> float:
    """Harmonic mean of the readings up to `reach` beams away."""
    window = ranges[beam - reach : beam + reach + 1]
    return len(window) / np.sum(1 / window)


RANGES = 1.0 + 0.001 * np.array([0, 3, -2, 5, 1, -4, 2, 0, -3, 4, 1, -1])


@pytest.mark.parametrize("window", [3, 5, 7])
def test_the_mean_is_harmonic_and_its_window_shrinks_at_the_ends(window):
    smoothed = smooth(np.stack([RANGES, RANGES[::-1]]), window=window)
    for beam in range(12):
        expected = mean_by_hand(RANGES, beam, min(window // 2, beam, 11 - beam))
        assert smoothed[0, beam] == pytest.approx(expected, abs=1e-12)
        assert smoothed[1, 11 - beam] == pytest.approx(expected, abs=1e-12)


def test_five_readings_are_averaged_by_default():
    np.testing.assert_array_equal(smooth(RANGES), smooth(RANGES, window=5))


def test_the_window_shrinks_before_a_jump_and_a_beam_without_return():
    jump = RANGES + 0.5 * (np.arange(12) >= 6)
    gap = np.where(np.arange(12) == 6, np.nan, RANGES)
    for ranges, left in ((jump, (5, 4, 3)), (gap, (5, 4, 3))):
        smoothed = smooth(ranges)[0]
        for beam, reach in zip(left, (0, 1, 2), strict=True):
            assert smoothed[beam] == pytest.approx(mean_by_hand(ranges, beam, reach), abs=1e-12)
    assert smooth(jump)[0, 6] == pytest.approx(jump[6])
    assert smooth(jump)[0, 7] == pytest.approx(mean_by_hand(jump, 7, 1), abs=1e-12)
    assert smooth(jump)[0, 8] == pytest.approx(mean_by_hand(jump, 8, 2), abs=1e-12)
    assert np.isnan(smooth(gap)[0, 6])
    assert smooth(gap)[0, 8] == pytest.approx(mean_by_hand(gap, 8, 1), abs=1e-12)


def bend(place: int, change: float, distance: float = 1.0, beams: int = 21) -> np.ndarray:
    """Ranges whose inverse bends at one beam: two surfaces that meet there."""
    return 1.0 / (1.0 / distance + change * np.maximum(0, np.arange(beams) - place))


def test_a_window_may_end_at_a_crease_but_not_go_over_it():
    ranges = bend(10, 0.018)
    assert np.flatnonzero(find_creases(ranges[None])).tolist() == [10]
    smoothed = smooth(ranges, window=7)[0]
    for beam, reach in ((6, 3), (7, 3), (8, 2), (9, 1), (11, 1), (12, 2), (13, 3)):
        assert smoothed[beam] == pytest.approx(mean_by_hand(ranges, beam, reach), abs=1e-12)
    assert smoothed[10] == pytest.approx(ranges[10]), "the crease itself stays sharp"


def test_across_jumps_everything_near_is_averaged():
    ranges = np.where(np.arange(12) == 3, np.nan, RANGES + 0.5 * (np.arange(12) >= 6))
    smoothed = smooth(ranges, across_jumps=True)[0]
    for beam in range(12):
        window = ranges[max(beam - 2, 0) : beam + 3]
        expected = np.nan if beam == 3 else np.nanmean(window)
        assert smoothed[beam] == pytest.approx(expected, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("across_jumps", [True, False])
def test_a_scan_may_be_shorter_than_the_window(across_jumps):
    for beams in range(1, 5):
        smoothed = smooth(RANGES[:beams], window=9, across_jumps=across_jumps)[0]
        for beam in range(beams):
            reach = min(beam, beams - 1 - beam)
            symmetric = mean_by_hand(RANGES, beam, reach)
            expected = RANGES[:beams].mean() if across_jumps else symmetric
            assert smoothed[beam] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("distance", "least"), [(1.0, 0.034), (5.0, 0.05)])
def test_a_crease_bends_more_than_three_centimeters_and_four_millimeters_a_meter(distance, least):
    """Two beams to either side the bend is twice the change of 1/r from beam to beam."""
    for share, found in ((1.03, [10]), (0.97, [])):
        ranges = bend(10, share * least / 2 / distance**2, distance)[None]
        assert np.flatnonzero(find_creases(ranges)).tolist() == found
    mirrored = bend(10, 1.03 * least / 2 / distance**2, distance)[None, ::-1]
    assert np.flatnonzero(find_creases(mirrored)).tolist() == [10]


def test_the_bend_of_a_crease_is_a_parameter():
    ranges = bend(10, 0.01)[None]
    assert not find_creases(ranges).any()
    assert find_creases(ranges, crease=0.01, crease_per_meter=0.009)[0, 10]
    assert not find_creases(ranges, crease=0.01, crease_per_meter=0.011).any()


def test_creases_at_the_rim_of_a_scan_and_in_short_ones():
    assert np.flatnonzero(find_creases(bend(2, 0.05, beams=5)[None])).tolist() == [2]
    assert not find_creases(bend(2, 0.05, beams=4)[None]).any()
    assert np.flatnonzero(find_creases(bend(18, 0.05)[None])).tolist() == [18]
    assert np.flatnonzero(find_creases(bend(2, 0.05)[None])).tolist() == [2]


def test_a_beam_without_return_is_no_crease():
    ranges = np.ones((1, 21))
    ranges[0, 10] = np.nan
    assert not find_creases(ranges).any()


@pytest.mark.parametrize("missing", [7, 13])
def test_a_beam_without_return_nearby_hides_no_crease(missing):
    """Three beams away: the crease itself can be told, the bend beside it cannot."""
    ranges = bend(10, 0.018)[None]
    ranges[0, missing] = np.nan
    assert np.flatnonzero(find_creases(ranges)).tolist() == [10]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("across_jumps", [True, False])
def test_beams_without_return_are_no_reason_to_warn(across_jumps):
    ranges = np.stack([np.where(np.arange(12) % 5 == 0, np.nan, RANGES), np.full(12, np.nan)])
    assert np.isfinite(smooth(ranges, across_jumps=across_jumps)[0]).sum() == 9
