"""Leveling, smoothing, mixed pixels, cropping and thinning."""

import numpy as np
import pytest
from constants import with_constants
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from reconstruction._src.scans.cells import SparsePointsConfig, as_points, crop, find_sparse_points, thin
from reconstruction._src.scans.smoothing import SmoothingConfig, find_creases, smooth_ranges
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ScanError
from reconstruction._src.geometry.pose import make_pose
from reconstruction._src.scans import mixed_pixels
from reconstruction._src.scans.leveling import LevelingConfig, estimate_declination, level_floor
from reconstruction._src.scans.mixed_pixels import find_jumps, find_mixed_beams
from reconstruction._src.scans.preprocess import PreprocessConfig, preprocess, remove_mixed_pixels
from reconstruction._src.scans.scan import ScanLog, load_scan_log

HEIGHT = 2.0
ANGLES = np.radians(np.linspace(-90, 90, 361))
NONE, ALL = 0.0, 1.0


def find_mixed(ranges, max_share):
    with with_constants(mixed_pixels, max_share=max_share):
        return find_mixed_beams(ranges)


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
        foot = HEIGHT * s
        origin_x, origin_z = foot, HEIGHT * c
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


@pytest.mark.parametrize("step_at", [1.0, 2.0])
def test_declination_is_found_next_to_a_plateau_and_through_noise(step_at):
    roll = np.radians(np.linspace(-2, 2, 21))
    log = make_log(roll, step_at=step_at, noise=0.006)
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


def test_smoothing_keeps_planes_and_halves_noise():
    exact, noisy = make_log([0.0] * 20), make_log([0.0] * 20, noise=0.006)
    near = exact.ranges < 4
    assert np.nanmax(np.abs(smooth_ranges(exact).ranges - exact.ranges)[near]) < 1e-3
    error = (smooth_ranges(noisy).ranges - exact.ranges)[near & np.isfinite(noisy.ranges)]
    assert np.sqrt(np.mean(error**2)) < 0.6 * 0.006


def test_smoothing_stops_at_jumps_unless_asked():
    log = ScanLog(np.where(np.arange(40) < 20, 1.0, 2.0)[None], np.zeros(40), np.eye(4)[None])
    np.testing.assert_allclose(smooth_ranges(log).ranges, log.ranges)
    across = smooth_ranges(log, across_jumps=True).ranges[0]
    assert across[19] == pytest.approx(1.4)
    assert across[18] == pytest.approx(1.2)


def test_window_one_changes_nothing():
    log = make_log([0.0], noise=0.006)
    np.testing.assert_allclose(smooth_ranges(log, window=1).ranges, log.ranges)


def test_smoothing_keeps_creases_sharp():
    """A floor 2 m below that meets a wall 3 m away: no range jump, but a corner."""
    angles = np.radians(np.arange(-60, 20, 0.5))
    floor = np.where(angles < 0, 2.0 / -np.sin(np.minimum(angles, -1e-9)), np.inf)
    ranges = np.minimum(floor, 3.0 / np.cos(angles))[None]
    log = ScanLog(ranges, angles, np.eye(4)[None])
    corner = int(np.argmax(floor > 3.0 / np.cos(angles)))
    assert not find_jumps(ranges).any()
    assert set(np.flatnonzero(find_creases(ranges))) <= {corner - 1, corner}
    inner = slice(2, -2)
    sharp, round_ = smooth_ranges(log).ranges, smooth_ranges(log, across_jumps=True).ranges
    assert np.abs(sharp - ranges)[0, inner].max() < 0.01
    assert np.abs(round_ - ranges)[0, inner].max() > 0.02


@pytest.mark.parametrize("window", [0, 2, -1])
def test_windows_without_a_middle_are_refused(window):
    with pytest.raises(ScanError, match="window"):
        smooth_ranges(make_log([0.0]), window=window)


def test_jumps_are_edges_and_not_slanted_planes():
    floor = scan_floor(np.zeros(1))
    assert not find_jumps(floor).any()
    broken = np.where(np.arange(361) < 150, floor, floor + 0.2)
    jumps = np.flatnonzero(find_jumps(broken))
    assert jumps.tolist() == [149]


def test_a_mixed_pixel_goes_and_its_surroundings_stay():
    ranges = np.where(np.arange(60) < 30, 1.5, 2.5)[None] + np.zeros((4, 1))
    ranges[:, 30] = 2.0
    is_mixed = find_mixed(ranges, NONE)
    assert np.argwhere(is_mixed).tolist() == [[i, 30] for i in range(4)]
    assert find_mixed(ranges, ALL)[:, 28:34].tolist() == [[0, 1, 1, 1, 0, 0]] * 4


def test_the_share_of_mixed_beams_is_kept():
    ranges = np.random.default_rng(0).uniform(1, 5, (50, 100))
    least, most = (
        find_mixed(ranges, NONE),
        find_mixed(ranges, 0.1),
    )
    assert 0 < most.sum() - least.sum() <= 0.1 * ranges.size


def test_isolated_points_go_and_a_surface_stays():
    rng = np.random.default_rng(0)
    surface = np.c_[rng.uniform(0, 2, (20000, 2)), np.zeros(20000)]
    isolated = np.c_[rng.uniform(0, 2, (100, 2)), rng.uniform(0.3, 2, 100)]
    is_sparse = find_sparse_points(np.concatenate([surface, isolated]))
    assert is_sparse[:20000].mean() < 0.01
    assert is_sparse[20000:].mean() > 0.97
    kept = remove_mixed_pixels(np.concatenate([surface, isolated]))
    np.testing.assert_array_equal(kept, np.concatenate([surface, isolated])[~is_sparse])


def test_crop_keeps_the_box():
    points = np.array([[0, 0, 0], [0.5, 0.5, 1.04], [2, 0, 0], [0, -1, 0.0]])
    np.testing.assert_allclose(crop(points, [[0, 0, 0], [1, 1, 1]]), points[:2])
    np.testing.assert_allclose(crop(points, [[0, 0, 0], [1, 1, 1]], margin=0), points[:1])
    with pytest.raises(ScanError, match="box"):
        crop(points, [0, 1])


def test_thinning_gives_one_mean_a_cube():
    points = np.array([[0.01, 0, 0], [0.03, 0, 0], [0.5, 0.5, 0.5]])
    np.testing.assert_allclose(thin(points, 0.1), [[0.02, 0, 0], [0.5, 0.5, 0.5]])
    assert thin(np.empty((0, 3)), 0.1).shape == (0, 3)
    for voxel in (0.0, -1.0, np.nan, 1e-12):
        with pytest.raises(ScanError, match=r"voxel|cells"):
            thin(points * 1e9, voxel)


def test_points_of_another_shape_are_refused():
    for bad in (np.ones(3), np.ones((3, 2)), [["a", "b", "c"]]):
        with pytest.raises(ScanError, match="points"):
            as_points(bad)


def make_veiled_log(spacing: int = 1) -> ScanLog:
    """A floor with a ledge on the left, veil points at its edge, and one isolated reading in the air, beams thinned."""
    log = make_log([0.0] * 40)
    ranges = log.ranges.copy()
    ranges[:, :150] -= 0.5
    ranges[:, 150] = (ranges[:, 149] + ranges[:, 151]) / 2
    ranges[20, 330] = 1.0
    return ScanLog(ranges[:, ::spacing], ANGLES[::spacing], log.poses, mount=log.mount)


@pytest.mark.parametrize("spacing", [1, 2, 3])
def test_a_log_loses_veil_points_and_isolated_readings_and_keeps_the_rest_as_it_is(spacing):
    log = make_veiled_log(spacing)
    clean = remove_mixed_pixels(log)
    assert isinstance(clean, ScanLog)
    is_mixed = find_mixed_beams(log.ranges, log.angles)
    place = 150 // spacing
    assert is_mixed[:, place].all()
    assert np.isnan(clean.ranges[is_mixed]).all()
    assert np.isnan(clean.ranges[20, 330 // spacing])
    kept = clean.is_valid
    assert np.array_equal(clean.ranges[kept], log.ranges[kept])
    assert kept.sum() >= (log.is_valid & ~is_mixed).sum() * 0.995
    assert np.array_equal(clean.poses, log.poses)


def test_two_neighboring_readings_are_not_isolated():
    log = make_veiled_log()
    ranges = log.ranges.copy()
    ranges[10, 345:347] = 1.0
    pair = log.replace(ranges=ranges)
    assert remove_mixed_pixels(pair).is_valid.sum() == remove_mixed_pixels(log).is_valid.sum() + 2
    assert len(preprocess(pair)) == len(preprocess(log)) + 2


def test_of_very_many_lonely_readings_only_few_go():
    """At most half a percent of a log: what its scans do not show as mixed is mostly thin, not wrong."""
    log = make_log([0.0] * 40)
    rng = np.random.default_rng(0)
    scans, beams = np.nonzero(log.is_valid)
    lonely = rng.choice(len(scans), 400, replace=False)
    ranges = log.ranges.copy()
    ranges[scans[lonely], beams[lonely]] *= rng.uniform(0.2, 0.9, 400)
    log = log.replace(ranges=ranges)
    is_left = log.is_valid & ~find_mixed_beams(log.ranges, angles=log.angles)
    least = 0.995 * is_left.sum()
    cleaned = remove_mixed_pixels(log)
    assert isinstance(cleaned, ScanLog)
    assert least <= cleaned.is_valid.sum() < is_left.sum()
    assert least <= len(preprocess(log)) < is_left.sum()


@pytest.mark.parametrize("spacing", [1, 2, 3])
def test_preprocessing_filters_the_readings_as_they_came_and_then_smooths_them(spacing):
    log = make_veiled_log(spacing)
    level = level_floor(log)
    is_mixed = find_mixed_beams(level.ranges, level.angles)
    for across_jumps in (False, True):
        filtered = level.replace(ranges=np.where(is_mixed, np.nan, level.ranges))
        expected = smooth_ranges(filtered, across_jumps=across_jumps).points()
        points = preprocess(log, across_jumps=across_jumps)
        distance, _ = cKDTree(points).query(expected)
        to_raw = cKDTree(points).query(log.points())[0]
        assert 0.995 * len(expected) <= len(points) < len(expected)
        assert (distance < 1e-9).sum() == len(points)
        assert to_raw.max() > 0.3, "the reading in the air"
    np.testing.assert_array_equal(preprocess(log), preprocess(log, across_jumps=False))
    assert not np.array_equal(preprocess(log), preprocess(log, across_jumps=True))


def test_a_log_with_a_box_is_cropped_unless_it_is_turned_off():
    log = make_log([0.0] * 40)
    everything = preprocess(log)
    low, high = everything.min(axis=0) - 1, everything.max(axis=0) + 1
    box = np.array([low, [high[0], (low[1] + high[1]) / 2, high[2]]])
    boxed = ScanLog(log.ranges, log.angles, log.poses, mount=log.mount, box=box)
    np.testing.assert_allclose(preprocess(boxed, cropped=False), everything)
    cropped = preprocess(boxed)
    assert 0.1 * len(everything) < len(cropped) < 0.6 * len(everything)
    assert len(cropped) == pytest.approx(len(crop(everything, box)), abs=5)
    assert (cropped <= box[1] + 0.1).all()


def test_progress_is_reported_before_each_step():
    reports = []
    preprocess(make_log([0.0]), progress=lambda text, share: reports.append((text, share)))
    assert reports == [("leveling", 0.0), ("filtering", 0.3), ("smoothing", 0.6)]
    reports.clear()
    preprocess(np.zeros((3, 3)), progress=lambda text, share: reports.append((text, share)))
    assert reports == [("filtering", 0.0)]


def test_the_settings_are_those_of_the_steps():
    log = make_veiled_log()
    np.testing.assert_array_equal(preprocess(log, config=PreprocessConfig()), preprocess(log))
    across = PreprocessConfig(smoothing=SmoothingConfig(across_jumps=True))
    np.testing.assert_array_equal(preprocess(log, config=across), preprocess(log, across_jumps=True))
    np.testing.assert_array_equal(preprocess(log, config=across, across_jumps=False), preprocess(log))
    for config in (
        PreprocessConfig(smoothing=SmoothingConfig(window=1)),
        PreprocessConfig(sparse_readings=SparsePointsConfig(max_share=0.0)),
    ):
        assert not np.array_equal(preprocess(log, config=config), preprocess(log)), config
    boxed = log.replace(box=np.array([[-9, -9, -9], [9, 9, -0.02]]))
    assert len(preprocess(boxed)) > 0 == len(preprocess(boxed, config=PreprocessConfig(crop_margin=0.0)))
    tilted, config = make_log([0.02] * 40), PreprocessConfig(leveling=LevelingConfig(max_tilt=0.01))
    assert np.ptp(preprocess(tilted)[:, 2]) < 0.5 * np.ptp(preprocess(tilted, config=config)[:, 2])


def test_options_of_a_step_replace_those_of_its_settings():
    log = make_log(np.radians([-3.0, 3.0]))
    np.testing.assert_array_equal(
        level_floor(log, np.radians(1.0)).poses,
        level_floor(log, config=LevelingConfig(max_tilt=np.radians(1.0))).poses,
    )
    np.testing.assert_array_equal(
        level_floor(log, tolerance=0.01).poses, level_floor(log, config=LevelingConfig(tolerance=0.01)).poses
    )
    wide = SmoothingConfig(window=9)
    np.testing.assert_array_equal(smooth_ranges(log, 9).ranges, smooth_ranges(log, config=wide).ranges)
    assert np.abs(estimate_declination(log, LevelingConfig(max_tilt=np.radians(1.0)))).max() < np.radians(
        1.01
    )


@pytest.mark.parametrize(
    ("config", "options", "reason"),
    [
        (LevelingConfig, {"max_tilt": 0.0}, "max_tilt"),
        (LevelingConfig, {"tolerance": -1.0}, "tolerance must be above 0"),
        (SmoothingConfig, {"window": 4}, "window"),
        (SmoothingConfig, {"crease": np.nan}, "crease must not be negative"),
        (SparsePointsConfig, {"max_share": -0.1}, "max_share"),
        (SparsePointsConfig, {"threshold": 0}, "threshold"),
    ],
)
def test_settings_out_of_range_are_refused(config, options, reason):
    with pytest.raises(ScanError, match=reason):
        config(**options)


RANGES = arrays.arrays(
    np.float64,
    st.tuples(st.integers(1, 4), st.integers(1, 30)),
    elements=st.floats(-1, 40, width=32) | st.sampled_from([np.nan, np.inf]),
)


@settings(max_examples=60, deadline=None)
@given(ranges=RANGES, across=st.booleans())
def test_any_log_is_processed(ranges, across):
    num_scans, num_beams = ranges.shape
    mount = vertical_mount()
    log = ScanLog(
        ranges, np.linspace(-1, 1, num_beams), make_pose(np.arange(num_scans), 0.0, 0.0) @ mount, mount=mount
    )
    points = preprocess(log, across_jumps=across)
    assert points.shape[1] == 3
    assert np.isfinite(points).all()
    assert len(points) <= log.is_valid.sum()
    for step in (level_floor, smooth_ranges, remove_mixed_pixels):
        assert step(log).ranges.shape == ranges.shape
    assert (remove_mixed_pixels(log).is_valid <= log.is_valid).all()
    assert (smooth_ranges(log).is_valid == log.is_valid).all()
    np.testing.assert_array_equal(points, preprocess(log, across_jumps=across))


@settings(max_examples=60, deadline=None)
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
