"""Units, axes, large coordinates, and sizes that are asked about."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.frames import (
    UNITS,
    UP_AXES,
    FrameConfig,
    describe_odd_size,
    find_offset,
    make_frame,
)
from reconstruction._src.scans.point_rows import RawPoints

POINTS = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, -6.0]])
AXES = {name: np.eye(3)["xyz".index(name[-1])] * (-1 if name[0] == "-" else 1) for name in UP_AXES}


@pytest.mark.parametrize("up", UP_AXES)
def test_the_axis_that_is_up_becomes_z_by_a_rotation(up: str) -> None:
    frame = make_frame(RawPoints(POINTS), up=up)
    assert np.linalg.det(frame.rotation) == 1
    np.testing.assert_array_equal(frame.place(AXES[up][None]), [[0, 0, 1]])
    np.testing.assert_array_equal(frame.place(POINTS), POINTS @ frame.rotation.T)


@pytest.mark.parametrize(
    ("unit", "meters"), [("ft", 0.3048), ("us-ft", 1200 / 3937), ("in", 0.0254), ("mm", 0.001)]
)
def test_units_and_scale_multiply(unit: str, meters: float) -> None:
    np.testing.assert_allclose(
        make_frame(RawPoints(POINTS), unit, scale=2.0).place(POINTS), POINTS * meters * 2
    )


def test_the_caller_decides_before_the_file_and_the_file_before_the_default() -> None:
    raw = RawPoints(POINTS, meters=0.01, up="y")
    assert make_frame(raw).factor == 0.01
    np.testing.assert_array_equal(make_frame(raw).rotation, UP_AXES["y"])
    assert make_frame(raw, "ft", "z").factor == 0.3048
    np.testing.assert_array_equal(make_frame(raw, "ft", "z").rotation, np.eye(3))
    assert make_frame(raw._replace(has_fixed_unit=True), "ft").factor == 0.01
    assert make_frame(RawPoints(POINTS)).place(POINTS) is POINTS


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"unit": "inch"}, "'inch'; there are: m, cm, mm, ft"),
        ({"up": "down"}, "'down'; there are: z, -z"),
        ({"scale": 0.0}, "scale must be above 0"),
        ({"scale": np.inf}, "scale must be above 0"),
        ({"scale": np.nan}, "scale must be above 0"),
    ],
)
def test_what_is_no_frame_is_refused(values: dict, reason: str) -> None:
    with pytest.raises(ScanError, match=reason):
        make_frame(RawPoints(POINTS), **values)


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
    assert describe_odd_size(np.array([[0.0, 0, 0], [0, 2700.0, 0]]), FrameConfig(largest=5000.0)) is None


@pytest.mark.parametrize("name", vars(FrameConfig()))
def test_configurations_refuse_bad_values(name: str) -> None:
    for value in (0.0, -1.0, np.nan):
        with pytest.raises(ScanError, match=name):
            FrameConfig(**{name: value})


def test_every_unit_is_a_length() -> None:
    assert all(0 < meters <= 1 for meters in UNITS.values())
