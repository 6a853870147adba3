"""Units, axes, large coordinates, and sizes that are asked about."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.frames import UP_AXES, RawPoints, describe_odd_size, find_offset, to_meters

POINTS = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, -6.0]])
AXES = {name: np.eye(3)["xyz".index(name[-1])] * (-1 if name[0] == "-" else 1) for name in UP_AXES}


@pytest.mark.parametrize("up", UP_AXES)
def test_the_axis_that_is_up_becomes_z_by_a_rotation(up: str) -> None:
    assert np.linalg.det(UP_AXES[up]) == 1
    np.testing.assert_array_equal(to_meters(AXES[up][None], RawPoints(POINTS), up=up), [[0, 0, 1]])
    np.testing.assert_array_equal(
        to_meters(POINTS, RawPoints(POINTS), up=up), POINTS @ np.transpose(UP_AXES[up])
    )


def test_units_and_scale_multiply() -> None:
    for unit, meters in (("us-ft", 1200 / 3937), ("in", 0.0254), ("mm", 0.001)):
        placed = to_meters(POINTS, RawPoints(POINTS), unit, scale=2.0)
        np.testing.assert_allclose(placed, POINTS * meters * 2)


def test_the_caller_decides_before_the_file_and_the_file_before_the_default() -> None:
    raw = RawPoints(POINTS, meters=0.01, up="y")
    np.testing.assert_allclose(to_meters(POINTS, raw), POINTS @ np.transpose(UP_AXES["y"]) * 0.01)
    np.testing.assert_allclose(to_meters(POINTS, raw, "ft", "z"), POINTS * 0.3048)
    fixed = raw._replace(has_fixed_unit=True, up=None)
    np.testing.assert_allclose(to_meters(POINTS, fixed, "ft"), POINTS * 0.01)
    assert to_meters(POINTS, RawPoints(POINTS)) is POINTS


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"unit": "inch"}, "'inch'; there are: m, cm, mm, ft"),
        ({"up": "down"}, "'down'; there are: z, -z"),
        ({"scale": 0.0}, "scale must be above 0"),
        ({"scale": np.nan}, "scale must be above 0"),
    ],
)
def test_what_is_no_frame_is_refused(values: dict, reason: str) -> None:
    with pytest.raises(ScanError, match=reason):
        to_meters(POINTS, RawPoints(POINTS), **values)


def sheet(extent: float, center: tuple[float, float, float]) -> np.ndarray:
    points = np.random.default_rng(0).uniform(-extent / 2, extent / 2, (500, 3)) + np.array(center)
    points[0] += 2 * extent  # the middle is the median
    return points


@pytest.mark.parametrize(
    ("extent", "center", "is_far"),
    [
        (300.0, (512_767.3, 5_403_706.8, 357.0), True),
        (10.0, (900.0, 0.0, 0.0), False),
        (10.0, (1100.0, 0.0, 0.0), True),
        (3000.0, (1500.0, 0.0, 0.0), False),  # the origin is at its rim
        (0.05, (200.0, 0.0, 0.0), True),
        (4.0, (0.0, 0.0, 0.0), False),
    ],
)
def test_large_coordinates_are_moved_by_whole_meters(extent: float, center: tuple, is_far: bool) -> None:
    points = sheet(extent, center)
    offset = find_offset(points)
    assert offset.any() == is_far
    np.testing.assert_array_equal(offset, np.round(offset))
    if is_far:
        assert np.abs(np.median(points - offset, axis=0)).max() <= 0.5
        rounded = (points - offset).astype(np.float32)
        assert np.abs(rounded - (points - offset)).max() <= 1e-6 * extent


def test_odd_sizes_are_described_and_others_are_not() -> None:
    for extent in (0.11, 5.0, 990.0):
        assert describe_odd_size(np.array([[0.0, 0, 0], [extent, 0, 0]])) is None
    assert (
        describe_odd_size(np.array([[0.0, 0, 0], [0, 2700.0, 0]]))
        == "its longest side is 2,700 m, above 1000 m"
    )
    assert (
        describe_odd_size(np.array([[0.0, 0, 0], [0.02, 0, 0]])) == "its longest side is 20 mm, below 10 cm"
    )
