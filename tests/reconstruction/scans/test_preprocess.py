"""Leveling, smoothing and filtering, and all of them composed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial import cKDTree

import reconstruction as rc
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.geometry.pose import make_pose
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.leveling import estimate_declination, level_floor
from reconstruction._src.scans.mixed_pixels import find_mixed_beams
from reconstruction._src.scans.preprocess import (
    find_creases,
    measure_dropped,
    preprocess,
    preprocess_cloud,
    remove_mixed_pixels,
    smooth_ranges,
)
from reconstruction._src.scans.scan import ScanLog, load_scan_log
from reconstruction._src.scans.selection import as_points, crop, thin

HEIGHT = 2.0
ANGLES = np.radians(np.linspace(-90, 90, 361))


def vertical_mount() -> np.ndarray:
    """A scanner 2 m up, its middle beam 60 degrees down to the right, as the survey's robot carries it."""
    c, s = 0.5, np.sqrt(0.75)
    mount = np.eye(4)
    mount[:3, :3] = np.array([[0, -c, -s], [0, -s, c], [-1, 0, 0]]).T
    mount[2, 3] = HEIGHT
    return mount


def scan_floor(roll: np.ndarray, step_at: float = np.inf, noise: float = 0.0) -> np.ndarray:
    """Ranges on the floor z = 0 from a robot that is tilted by roll; to the right of step_at it lies 0.25 m up."""
    down = np.sqrt(0.75) * np.cos(ANGLES) - 0.5 * np.sin(ANGLES)
    right = 0.5 * np.cos(ANGLES) + np.sqrt(0.75) * np.sin(ANGLES)
    rows = []
    for angle in roll:
        c, s = np.cos(angle), np.sin(angle)
        x, z = right * c - down * s, -(right * s + down * c)  # to the right and up
        origin_x, origin_z = HEIGHT * s, HEIGHT * c
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = -origin_z / z, (0.25 - origin_z) / z
            wall = (step_at - origin_x) / x
        on_high = (z < 0) & (origin_x + high * x >= step_at)
        ranges = np.where(z < 0, np.where(on_high, high, low), np.nan)
        at_wall = (x > 0) & (origin_z + wall * z > 0) & (origin_z + wall * z < 0.25)
        rows.append(np.where(at_wall, wall, ranges))
    ranges = np.stack(rows)
    ranges += noise * np.random.default_rng(0).standard_normal(ranges.shape)
    ranges[ranges > 8] = np.nan
    return ranges


def make_log(roll, **options) -> ScanLog:
    mount = vertical_mount()
    flat = make_pose(np.linspace(0, 1, len(roll)), 0.0, 0.3)
    return ScanLog(scan_floor(np.asarray(roll), **options), ANGLES, flat @ mount, mount=mount)


def test_the_floor_is_level_after_leveling():
    log = level_floor(make_log([-0.04, -0.01, 0.0, 0.02, 0.05]))
    assert np.abs(log.points()[:, 2]).max() < 1e-3


def test_declination_is_found_next_to_a_plateau_and_through_noise():
    roll = np.radians(np.linspace(-2, 2, 21))
    log = make_log(roll, step_at=1.0, noise=0.006)
    error = np.degrees(np.abs(np.abs(estimate_declination(log)) - np.abs(roll)))
    assert error.max() < 0.1


def test_a_log_without_a_mount_is_levelled_about_its_sensor():
    mount = vertical_mount()
    mount[:3, 3] = 0
    poses = make_pose(np.arange(5.0), 0.0, 0.0) @ mount
    level = level_floor(ScanLog(scan_floor(np.linspace(-0.03, 0.03, 5)), ANGLES, poses, mount=mount))
    assert np.ptp(level.points()[:, 2]) < 0.01


def test_scans_that_are_not_vertical_or_see_no_floor_are_left_alone():
    flat = ScanLog(np.ones((2, 361)), ANGLES, np.tile(np.eye(4), (2, 1, 1)))
    assert level_floor(flat).poses == pytest.approx(flat.poses)
    blind = make_log([0.0, 0.0]).replace(ranges=np.full((2, 361), np.nan))
    assert level_floor(blind).poses == pytest.approx(blind.poses)


def smooth(ranges: np.ndarray, **options) -> np.ndarray:
    angles = np.radians(0.5 * np.arange(len(ranges)))
    return smooth_ranges(ScanLog(ranges[None], angles, np.eye(4)[None]), **options).ranges[0]


def mean_by_hand(ranges: np.ndarray, beam: int, reach: int) -> float:
    """Harmonic mean of the readings up to `reach` beams away."""
    window = ranges[beam - reach : beam + reach + 1]
    return len(window) / np.sum(1 / window)


RANGES = 1.0 + 0.001 * np.array([0, 3, -2, 5, 1, -4, 2, 0, -3, 4, 1, -1])


@pytest.mark.parametrize(("window", "beams"), [(1, 12), (3, 12), (5, 12), (7, 12), (9, 1), (9, 4)])
def test_the_mean_is_harmonic_and_its_window_shrinks_at_the_ends(window, beams):
    ranges = RANGES[:beams]
    expected = [mean_by_hand(ranges, k, min(window // 2, k, beams - 1 - k)) for k in range(beams)]
    np.testing.assert_allclose(smooth(ranges, window=window), expected)


@pytest.mark.filterwarnings("error")
def test_the_window_shrinks_before_a_jump_and_a_beam_without_return():
    jump = RANGES + 0.5 * (np.arange(12) >= 6)
    gap = np.where(np.arange(12) == 6, np.nan, RANGES)
    for ranges, reaches in (
        (jump, {5: 0, 4: 1, 3: 2, 6: 0, 7: 1, 8: 2}),
        (gap, {5: 0, 4: 1, 3: 2, 7: 0, 8: 1}),
    ):
        smoothed = smooth(ranges)
        for beam, reach in reaches.items():
            assert smoothed[beam] == pytest.approx(mean_by_hand(ranges, beam, reach), abs=1e-12)
    assert np.isnan(smooth(gap)[6])


def bend(place: int, change: float, distance: float = 1.0, beams: int = 21) -> np.ndarray:
    """Ranges whose inverse bends at one beam: two surfaces that meet there."""
    return 1.0 / (1.0 / distance + change * np.maximum(0, np.arange(beams) - place))


def test_a_window_may_end_at_a_crease_but_not_go_over_it():
    ranges = bend(10, 0.018)
    smoothed = smooth(ranges, window=7)
    for beam, reach in ((6, 3), (7, 3), (8, 2), (9, 1), (11, 1), (12, 2), (13, 3)):
        assert smoothed[beam] == pytest.approx(mean_by_hand(ranges, beam, reach), abs=1e-12)
    assert smoothed[10] == pytest.approx(ranges[10]), "the crease itself stays sharp"


@pytest.mark.parametrize(("distance", "least"), [(1.0, 0.034), (5.0, 0.05)])
def test_a_crease_bends_more_than_three_centimeters_and_four_millimeters_a_meter(distance, least):
    """Two beams to either side the bend is twice the change of 1/r from beam to beam."""
    for share, found in ((1.03, [10]), (0.97, [])):
        ranges = bend(10, share * least / 2 / distance**2, distance)[None]
        assert np.flatnonzero(find_creases(ranges)).tolist() == found
    assert not find_creases(np.where(np.arange(21) == 10, np.nan, 1.0)[None]).any()


@pytest.mark.parametrize("window", [0, 2, -1])
def test_windows_without_a_middle_are_refused(window):
    with pytest.raises(ScanError, match="window"):
        smooth_ranges(make_log([0.0]), window=window)


def make_veiled_log(spacing: int = 1) -> ScanLog:
    """A floor with a ledge on the left, veil points at its edge, and one isolated reading in the air, beams thinned."""
    log = make_log([0.0] * 40)
    ranges = log.ranges.copy()
    ranges[:, :150] -= 0.5
    ranges[:, 150] = (ranges[:, 149] + ranges[:, 151]) / 2
    ranges[20, 330] = 1.0
    return ScanLog(ranges[:, ::spacing], ANGLES[::spacing], log.poses, mount=log.mount)


@pytest.mark.parametrize("spacing", [1, 3])
def test_a_log_loses_veil_points_and_isolated_readings_and_keeps_the_rest_as_it_is(spacing):
    log = make_veiled_log(spacing)
    clean = remove_mixed_pixels(log)
    is_mixed = find_mixed_beams(log.ranges, log.angles)
    assert is_mixed[:, 150 // spacing].all()
    assert np.isnan(clean.ranges[is_mixed]).all()
    assert np.isnan(clean.ranges[20, 330 // spacing])
    kept = clean.is_valid
    assert np.array_equal(clean.ranges[kept], log.ranges[kept])
    assert kept.sum() >= (log.is_valid & ~is_mixed).sum() * 0.995


def test_of_very_many_lonely_readings_only_few_go():
    """At most half a percent of a log: what its scans do not show as mixed is mostly thin, not wrong."""
    log = make_log([0.0] * 40)
    rng = np.random.default_rng(0)
    scans, beams = np.nonzero(log.is_valid)
    lonely = rng.choice(len(scans), 400, replace=False)
    ranges = log.ranges.copy()
    ranges[scans[lonely], beams[lonely]] *= rng.uniform(0.2, 0.9, 400)
    log = log.replace(ranges=ranges)
    is_left = log.is_valid & ~find_mixed_beams(log.ranges, log.angles)
    assert 0.995 * is_left.sum() <= len(preprocess(log)) < is_left.sum()


def test_preprocessing_filters_the_readings_as_they_came_and_then_smooths_them():
    log = make_veiled_log()
    is_mixed = find_mixed_beams(log.ranges, log.angles)
    level = level_floor(log.replace(ranges=np.where(is_mixed, np.nan, log.ranges)))
    expected, points = smooth_ranges(level).points(), preprocess(log)
    assert cKDTree(expected).query(points)[0].max() < 1e-9
    assert 0.995 * len(expected) <= len(points) < len(expected)


def test_a_log_with_a_box_is_cropped():
    log = make_log([0.0] * 40)
    everything = preprocess(log)
    low, high = everything.min(axis=0) - 1, everything.max(axis=0) + 1
    box = np.array([low, [high[0], (low[1] + high[1]) / 2, high[2]]])
    cropped = preprocess(log.replace(box=box))
    assert len(cropped) == pytest.approx(len(crop(everything, box)), abs=5)
    assert (cropped <= box[1]).all()


def test_points_of_a_log_keep_their_colors_and_viewpoints():
    log = make_veiled_log()
    cloud = preprocess_cloud(log)
    assert cloud.origins is not None
    assert np.linalg.norm(cloud.points - cloud.origins, axis=1).max() < 8.1
    colored = preprocess(log.replace(colors=np.full((*log.ranges.shape, 3), 7, np.uint8)))
    assert isinstance(colored, Cloud)
    np.testing.assert_array_equal(colored.points, preprocess(log))
    bare = Cloud(log.points(), viewpoints=np.zeros((1, 3)))
    np.testing.assert_array_equal(preprocess_cloud(bare).points, preprocess(log.points()))


def test_progress_is_reported_before_each_step():
    reports = []
    preprocess(make_log([0.0]), progress=lambda text, share: reports.append((text, share)))
    assert reports == [("leveling", 0.0), ("filtering", 0.3), ("smoothing", 0.6)]


@settings(max_examples=30, deadline=None)
@given(
    ranges=arrays.arrays(
        np.float64,
        st.tuples(st.integers(1, 4), st.integers(1, 30)),
        elements=st.floats(-1, 40, width=32) | st.sampled_from([np.nan, np.inf]),
    )
)
def test_any_log_is_processed(ranges):
    num_scans, num_beams = ranges.shape
    mount = vertical_mount()
    poses = make_pose(np.arange(num_scans), 0.0, 0.0) @ mount
    log = ScanLog(ranges, np.linspace(-1, 1, num_beams), poses, mount=mount)
    points = preprocess(log)
    assert np.isfinite(points).all()
    assert len(points) <= log.is_valid.sum()
    assert (remove_mixed_pixels(log).is_valid <= log.is_valid).all()
    assert (smooth_ranges(log).is_valid == log.is_valid).all()
    np.testing.assert_array_equal(points, preprocess(log))


@settings(max_examples=30, deadline=None)
@given(
    points=arrays.arrays(
        np.float64,
        st.tuples(st.integers(0, 120), st.just(3)),
        elements=st.floats(-100, 100, width=32) | st.sampled_from([np.nan, 0.0]),
    )
)
def test_any_cloud_is_processed(points):
    clean = preprocess(points)
    assert np.isfinite(clean).all()
    assert clean.shape[1] == 3
    assert len(thin(points, 0.5)) <= len(as_points(points))
    assert len(crop(points, [[-1, -1, -1], [1, 1, 1]])) <= len(points)


def make_walls() -> np.ndarray:
    """Return a wall at 3 m with 10,000 readings and one at 12 m with 600."""
    rng = np.random.default_rng(0)
    near = np.c_[np.full(10_000, 3.0), rng.uniform(-1.5, 1.5, (10_000, 2))]
    far = np.c_[np.full(600, 12.0), rng.uniform(-1.5, 1.5, (600, 2))]
    return np.concatenate([near, far])


def test_the_share_of_lost_readings_is_measured():
    points = make_walls()
    assert measure_dropped(points, points[:10_000]) == 600 / 10_600
    assert measure_dropped(points, points[::3] + 0.003) < 0.01, "thinned and moved readings are not lost"
    assert measure_dropped(points[:0], points) == 0.0
    assert measure_dropped(points, points[:0]) == 1.0


def test_a_far_wall_survives_pre_processing_and_strays_do_not():
    points = make_walls()
    rng = np.random.default_rng(1)
    strays = np.c_[rng.uniform(0.5, 2.5, 100), rng.uniform(-1.5, 1.5, (100, 2))]
    kept = preprocess(np.concatenate([points, strays]))
    assert (kept[:, 0] > 11).sum() >= 0.97 * 600
    assert (kept[:, 0] < 2.9).sum() <= 10


@pytest.mark.slow
def test_a_log_refines_a_surface():
    """A scanner that looks straight down moves 2 m along x, 1.5 m above level ground."""
    angles, height = np.linspace(-0.6, 0.6, 81), 1.5
    poses = np.tile(np.eye(4), (81, 1, 1))
    poses[:, :3, :3] = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    poses[:, 0, 3], poses[:, 2, 3] = np.linspace(-1, 1, 81), height
    rng = np.random.default_rng(0)
    log = ScanLog(height / np.cos(angles) + rng.normal(0, 0.002, (81, 81)), angles, poses)
    points = np.column_stack([rng.uniform(-1, 1, (6000, 2)), rng.normal(0, 0.003, 6000)])
    ground = rc.reconstruct(points, units=200)
    quality = ground.refine(log).quality()
    assert quality.cloud_to_mesh is not None
    assert quality.cloud_to_mesh.mean < 0.01
    with pytest.raises(ReconstructionError, match="its own origins"):
        ground.refine(log, origins=[0, 0, 1])
    with pytest.raises(ReconstructionError, match="in meters"):
        ground.refine(1000 * points)
    with pytest.raises(ReconstructionError, match="NaN"):
        ground.refine(points, origins=[0, 0, np.nan])


@pytest.mark.data
def test_a_real_scan_loses_its_veil_points_and_keeps_the_rest(shared_data):
    log = load_scan_log(shared_data / "3dtk_scan000.3d")
    assert log.ranges.shape == (226, 360)
    step = np.diff(log.ranges, axis=1)
    is_veil = np.zeros(log.ranges.shape, bool)
    before, after = step[:, :-1], step[:, 1:]
    is_veil[:, 1:-1] = (np.abs(before) > 0.1) & (np.abs(after) > 0.1) & (before * after > 0)
    kept = remove_mixed_pixels(log).is_valid
    assert is_veil.sum() == pytest.approx(0.028 * log.is_valid.sum(), rel=0.02)
    assert (is_veil & ~kept).sum() >= 0.90 * is_veil.sum()
    others = log.is_valid & ~is_veil
    assert (others & kept).sum() >= 0.97 * others.sum()
