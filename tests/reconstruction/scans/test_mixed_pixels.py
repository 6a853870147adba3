"""Edges in scans: steps known by hand."""

from itertools import combinations

import numpy as np
import pytest
from constants import with_constants

from reconstruction._src.scans import mixed_pixels
from reconstruction._src.scans.mixed_pixels import (
    find_jumps,
    find_mixed_beams,
    find_noise,
    find_step,
    select_needed_beams,
)
from reconstruction._src.scans.scan import ScanLog


def lay_steps(*places: int, height: float = 0.04, beams: int = 60, distance: float = 1.0) -> np.ndarray:
    """Ranges to a wall, farther by a step of some height [m] from each of these beams on."""
    beam = np.arange(beams)
    return distance + height * np.sum([beam >= place for place in places], axis=0)[None]


def slant(spacing_deg: float = 0.5, beams: int = 60) -> np.ndarray:
    """Ranges to a wall 1 m away met at 30 to 60 degrees."""
    return 1.0 / np.cos(np.radians(30 + spacing_deg * np.arange(beams)))[None]


def find_all(ranges):
    with with_constants(mixed_pixels, max_share=1.0):
        return find_mixed_beams(ranges)


def find_places(ranges: np.ndarray, **options: float) -> list[int]:
    """Return the beams of a scan that may have met an edge; however many there are, unless options say otherwise."""
    with with_constants(mixed_pixels, **({"max_share": 1.0} | options)):
        return np.flatnonzero(find_mixed_beams(ranges)[0]).tolist()


def test_a_ledge_of_four_centimeters_is_an_edge_and_one_of_two_is_not():
    """At 1 m; where there is an edge, the beams on both sides count as mixed."""
    for height in (0.04, -0.04, 0.5):
        assert find_places(lay_steps(30, height=height)) == [29, 30]
    assert find_places(lay_steps(30, height=0.02)) == []


def test_farther_away_an_edge_is_higher():
    """By 3 mm a meter."""
    assert find_places(lay_steps(30, height=0.048, distance=5.0)) == [29, 30]
    assert find_places(lay_steps(30, height=0.042, distance=5.0)) == []


@pytest.mark.parametrize(
    ("places", "mixed"),
    [
        ((25,), [24, 25]),
        ((25, 30), [24, 25, 26, 27, 28, 29, 30]),
        ((25, 31), [24, 25, 27, 28, 30, 31]),
        ((25, 32), [24, 25, 28, 31, 32]),
        ((25, 33), [24, 25, 32, 33]),
        ((25, 40), [24, 25, 39, 40]),
    ],
)
def test_a_beam_with_four_mixed_ones_among_nine_is_mixed(places, mixed):
    """An edge along the scan: two jumps within nine beams leave few that can be trusted."""
    assert find_places(lay_steps(*places)) == mixed
    both = np.concatenate([lay_steps(*places), lay_steps(50, height=0.0), lay_steps(*places)])
    flags = find_all(both)
    assert [np.flatnonzero(row).tolist() for row in flags] == [mixed, [], mixed]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_veil_point_lies_between_two_surfaces(sign):
    """Two steps of more than 10 cm the same way; whatever the share of mixed beams."""
    ranges = lay_steps(30, 31, height=sign * 0.11, distance=2.0)
    assert find_places(ranges, max_share=0.0) == [30]
    assert find_places(lay_steps(30, 31, height=sign * 0.09, distance=2.0), max_share=0.0) == []
    assert find_places(lay_steps(30, 31, height=sign * 0.09, distance=2.0), max_share=0.0, step=0.08) == [30]
    post = lay_steps(30, height=sign * 0.5, distance=2.0) - lay_steps(31, height=sign * 0.5, distance=0.0)
    assert find_places(post, max_share=0.0) == []
    assert find_places(lay_steps(1, 2, height=sign * 0.2, distance=2.0), max_share=0.0) == [1]
    assert find_places(lay_steps(58, 59, height=sign * 0.2, distance=2.0), max_share=0.0) == [58]


def test_the_higher_of_two_jumps_goes_first():
    """Of 100 beams two may go by default, in addition to the veil points."""
    ranges = lay_steps(30, beams=100) + lay_steps(70, beams=100, height=0.3, distance=0.0)
    assert (
        find_places(ranges, max_share=0.02)
        == np.flatnonzero(find_mixed_beams(ranges)[0]).tolist()
        == [69, 70]
    )
    assert find_places(ranges, max_share=0.04) == [29, 30, 69, 70]
    assert find_places(ranges, max_share=0.039) == [69, 70]
    ranges[0, :10] = np.nan  # two of a hundred are fewer than two of the rest
    assert find_places(ranges, max_share=0.02) == []
    assert find_places(ranges, max_share=0.025) == [69, 70]


def test_clutter_goes_after_all_jumps():
    ranges = lay_steps(25, 30, beams=100)
    assert find_places(ranges, max_share=0.04) == [24, 25, 29, 30]
    assert find_places(ranges, max_share=0.07) == list(range(24, 31))


def test_one_beam_without_return_hides_no_edge_and_makes_none():
    for ranges, found in (
        (lay_steps(30, height=0.5), [28, 30]),
        (lay_steps(30, height=0.0), []),
        (slant(), []),
    ):
        ranges[0, 29] = np.nan
        assert find_places(ranges) == found
        ranges[0, 28:30] = np.nan
        assert find_places(ranges) == []


def test_a_beam_without_return_beside_an_edge_is_filled_from_its_own_side():
    for place, found in ((31, [30, 31]), (28, [27, 28]), (59, [58, 59])):
        ranges = lay_steps(place, height=0.5)
        ranges[0, 29] = np.nan
        assert find_places(ranges) == found
    ranges = lay_steps(30, height=0.5)
    ranges[0, [1, 58]] = np.nan
    assert find_places(ranges) == [29, 30]


def test_beyond_the_rim_of_a_scan_there_is_no_doubt():
    assert find_places(lay_steps(3)) == [2, 3]
    assert find_places(lay_steps(57)) == [56, 57]


def test_veils_do_not_count_among_the_doubtful_beams():
    ranges = lay_steps(30, 31, beams=100, height=0.2) + lay_steps(70, beams=100, height=0.05, distance=0.0)
    assert find_places(ranges, max_share=0.04) == [29, 30, 31, 69, 70]
    assert find_places(ranges, max_share=0.039) == [29, 30, 31]


def test_no_return_is_no_mixed_pixel():
    ranges = lay_steps(30, 31, height=0.5)
    ranges[0, 30] = np.nan
    assert find_places(ranges) == [29, 31]
    assert not find_mixed_beams(np.full((2, 20), np.nan)).any()


@pytest.mark.parametrize(
    ("noise", "least", "most"), [(0.004, 0.04, 0.04), (0.016, 0.08, 0.2), (0.1, 0.2, 0.4)]
)
def test_where_readings_are_noisy_an_edge_is_higher(noise, least, most):
    """Twice as high for 16 mm of noise, never more than three times; the noise shows in the other scans."""
    rng = np.random.default_rng(0)
    others = np.concatenate([1 + noise * rng.standard_normal((1, 2001)), np.ones((6, 2001))])
    jumps = []
    for height in np.arange(0.02, 0.3, 0.005):
        scans = np.concatenate(
            [others, np.pad(lay_steps(30, height=height), ((0, 0), (0, 1941)), mode="edge")]
        )
        if find_all(scans)[-1].any():
            jumps.append(height)
    expected = 0.033 * np.clip(noise / 0.008, 1, 3)
    assert min(jumps) == pytest.approx(expected, abs=0.009)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("spacing_deg", "beams", "step"),
    [
        (0.5, 361, 0.1),
        (0.25, 361, 0.1),
        (0.504, 361, 0.1),
        (1.0, 181, 0.2),
        (-1.0, 181, 0.2),
        (1.0, 2, 0.2),
        (1.0, 1, 0.1),
    ],
)
def test_beams_farther_apart_step_more(spacing_deg, beams, step):
    assert find_step(np.radians(spacing_deg * np.arange(beams))) == pytest.approx(step)


@pytest.mark.parametrize("distance", [1.0, 4.0])
@pytest.mark.parametrize("noise", [0.003, 0.02])
def test_noise_is_found_on_a_plane_however_it_is_met(distance, noise):
    rng = np.random.default_rng(1)
    exact = distance * slant(0.01, 3000)
    noisy = exact + noise * rng.standard_normal((16, 3000))
    assert find_noise(noisy) == pytest.approx(noise, rel=0.06)
    noisy[:, ::7] = np.nan
    assert find_noise(noisy) == pytest.approx(noise, rel=0.06)
    assert find_noise(exact) < 1e-5 * distance
    noisy[1:8] = 3 * rng.random((7, 3000)) + 1  # one scan in eight is asked
    noisy[9:] = noisy[1:8]
    assert find_noise(noisy) == pytest.approx(noise, rel=0.06)


def test_without_three_beams_side_by_side_there_is_no_noise():
    assert find_noise(np.ones((3, 2))) == 0.0
    assert find_noise(np.array([[1.0, 1.1, np.nan, 1.0, 1.2]])) == 0.0


@pytest.mark.parametrize("distance", [1.0, 4.0])
def test_a_jump_is_more_than_three_centimeters_and_four_millimeters_a_meter(distance):
    threshold = 0.03 + 0.004 * distance
    assert np.flatnonzero(find_jumps(lay_steps(30, height=1.05 * threshold, distance=distance))).tolist() == [
        29
    ]
    assert not find_jumps(lay_steps(30, height=0.95 * threshold, distance=distance)).any()
    assert find_jumps(lay_steps(30, height=0.02), jump=0.01, jump_per_meter=0.005).any()
    assert not find_jumps(lay_steps(30, height=0.02), jump=0.01, jump_per_meter=0.015).any()


@pytest.mark.parametrize("number", range(5))
def test_a_jump_is_like_no_two_of_its_neighboring_steps(number):
    """A step of 1/r that two of its four neighbors repeat is a surface at an angle."""
    for like in combinations((28, 29, 31, 32), number):
        steps = np.zeros(60)
        steps[[30, *like]] = 0.06
        ranges = 1.0 / (1.2 - np.r_[0.0, np.cumsum(steps)])[None]
        assert find_jumps(ranges)[0, 30] == (number < 2), like


def test_steps_at_the_ends_of_a_scan_have_fewer_neighbors():
    for place in (1, 2, 57, 58, 59):
        assert np.flatnonzero(find_jumps(lay_steps(place, height=0.5))).tolist() == [place - 1]
    assert not find_jumps(lay_steps(1, height=0.0)).any()
    assert find_jumps(np.ones((3, 1))).shape == (3, 0)
    assert find_jumps(slant(3.0, 19)).sum() == 0


def test_a_wall_at_a_low_angle_stays_and_most_of_a_veil_goes():
    """A wall 1 m beside the sensor, seen to 12 m along it: beams step by more than 10 cm from 3.4 m on."""
    angles = np.radians(np.arange(4.0, 60.0, 0.5))
    rng = np.random.default_rng(0)
    wall = 1.0 / np.sin(angles)[None] + rng.normal(0, 0.005, (40, len(angles)))
    wall[:, 80:] = 6.0  # a second wall behind its end
    wall[:, 79] = rng.uniform(2.0, 5.5, 40)  # beams that met the end of the first
    poses = np.tile(np.eye(4), (40, 1, 1))
    poses[:, 2, 3] = 0.1 * np.arange(40)
    log = ScanLog(wall, angles, poses)
    is_mixed = find_mixed_beams(log.ranges, log.angles)
    is_needed = select_needed_beams(log, is_mixed)
    far = (wall[:, :20] > 4.0) & (wall[:, :20] < 9.0)
    assert is_mixed[:, :20][far].mean() > 0.5
    assert (is_mixed & ~is_needed)[:, :20][far].mean() < 0.15
    assert is_mixed[:, 79].mean() > 0.9
    assert is_needed[:, 79].mean() < 0.25
    assert not (is_needed & ~is_mixed).any()
    assert not select_needed_beams(log, np.zeros_like(is_mixed)).any()
    assert not select_needed_beams(log, np.ones_like(is_mixed)).any()
