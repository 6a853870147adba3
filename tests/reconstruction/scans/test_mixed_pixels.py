"""Edges in scans: steps known by hand."""

from itertools import combinations

import numpy as np
import pytest
from constants import with_constants

from reconstruction._src.scans import mixed_pixels
from reconstruction._src.scans.mixed_pixels import find_jumps, find_mixed_beams, select_needed_beams
from reconstruction._src.scans.scan import ScanLog


def lay_steps(*places: int, height: float = 0.04, beams: int = 60, distance: float = 1.0) -> np.ndarray:
    """Ranges to a wall, farther by a step of some height [m] from each of these beams on."""
    beam = np.arange(beams)
    return distance + height * np.sum([beam >= place for place in places], axis=0)[None]


def slant(spacing_deg: float = 0.5, beams: int = 60) -> np.ndarray:
    """Ranges to a wall 1 m away met at 30 to 60 degrees."""
    return 1.0 / np.cos(np.radians(30 + spacing_deg * np.arange(beams)))[None]


def find_places(ranges: np.ndarray, spacing_deg: float = 0.5, max_share: float = 1.0) -> list[int]:
    """Return the beams of a scan that may have met an edge; however many there are, unless options say otherwise."""
    angles = np.radians(spacing_deg * np.arange(ranges.shape[1]))
    with with_constants(mixed_pixels, max_share=max_share):
        return np.flatnonzero(find_mixed_beams(ranges, angles)[0]).tolist()


def test_a_slanted_wall_has_no_edge():
    assert find_places(slant()) == []


def test_an_edge_of_four_centimeters_is_found_and_one_of_two_is_not():
    """At 1 m; where there is an edge, the beams on both sides count as mixed. By 3 mm a meter it is higher."""
    for height in (0.04, -0.04, 0.5):
        assert find_places(lay_steps(30, height=height)) == [29, 30]
    assert find_places(lay_steps(30, height=0.02)) == []
    assert find_places(lay_steps(30, height=0.048, distance=5.0)) == [29, 30]
    assert find_places(lay_steps(30, height=0.042, distance=5.0)) == []
    assert find_places(lay_steps(3)) == [2, 3]
    assert find_places(lay_steps(57)) == [56, 57]


@pytest.mark.parametrize(
    ("places", "mixed"),
    [
        ((25, 30), [24, 25, 26, 27, 28, 29, 30]),
        ((25, 31), [24, 25, 27, 28, 30, 31]),
        ((25, 32), [24, 25, 28, 31, 32]),
        ((25, 33), [24, 25, 32, 33]),
    ],
)
def test_a_beam_with_four_mixed_ones_among_nine_is_mixed(places, mixed):
    """An edge along the scan: two jumps within nine beams leave few that can be trusted."""
    assert find_places(lay_steps(*places)) == mixed


@pytest.mark.parametrize("sign", [1, -1])
def test_a_veil_point_lies_between_two_surfaces(sign):
    """Two steps of more than 10 cm the same way; whatever the share of mixed beams."""
    ranges = lay_steps(30, 31, height=sign * 0.11, distance=2.0)
    assert find_places(ranges, max_share=0.0) == [30]
    assert find_places(ranges, 1.0, max_share=0.0) == [], "beams farther apart step more"
    assert find_places(lay_steps(30, 31, height=sign * 0.09, distance=2.0), max_share=0.0) == []
    post = lay_steps(30, height=sign * 0.5, distance=2.0) - lay_steps(31, height=sign * 0.5, distance=0.0)
    assert find_places(post, max_share=0.0) == []


def test_the_higher_of_two_jumps_goes_first():
    """Of 100 beams two may go by default, in addition to the veil points."""
    ranges = lay_steps(30, beams=100) + lay_steps(70, beams=100, height=0.3, distance=0.0)
    assert find_places(ranges, max_share=0.02) == [69, 70]
    assert find_places(ranges, max_share=0.04) == [29, 30, 69, 70]
    assert find_places(ranges, max_share=0.039) == [69, 70]


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
    assert find_places(np.full((2, 20), np.nan)) == []


@pytest.mark.parametrize("distance", [1.0, 4.0])
def test_a_jump_is_more_than_three_centimeters_and_four_millimeters_a_meter(distance):
    threshold = 0.03 + 0.004 * distance
    for place in (1, 30, 59):
        ranges = lay_steps(place, height=1.05 * threshold, distance=distance)
        assert np.flatnonzero(find_jumps(ranges)).tolist() == [place - 1]
    assert not find_jumps(lay_steps(30, height=0.95 * threshold, distance=distance)).any()


@pytest.mark.parametrize("number", range(5))
def test_a_jump_is_like_no_two_of_its_neighboring_steps(number):
    """A step of 1/r that two of its four neighbors repeat is a surface at an angle."""
    for like in combinations((28, 29, 31, 32), number):
        steps = np.zeros(60)
        steps[[30, *like]] = 0.06
        ranges = 1.0 / (1.2 - np.r_[0.0, np.cumsum(steps)])[None]
        assert find_jumps(ranges)[0, 30] == (number < 2), like


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
    assert not select_needed_beams(log, np.ones_like(is_mixed)).any()
