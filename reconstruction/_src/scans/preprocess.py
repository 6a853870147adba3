"""Leveling, smoothing and filtering of laser scans (paper, section II-A), composed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import overload

import numpy as np
from jaxtyping import Bool, Float, UInt8
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.rows import compute_lengths
from reconstruction._src.scans.cells import SparsePointsConfig, as_points, crop, find_sparse_points, thin
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import make_log_cloud
from reconstruction._src.scans.leveling import LevelingConfig, estimate_declination, level_floor
from reconstruction._src.scans.mixed_pixels import find_mixed_beams, select_needed_beams
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.selection import crop as crop_cloud
from reconstruction._src.scans.smoothing import SmoothingConfig, smooth_ranges

__all__ = [
    "PreprocessConfig",
    "crop",
    "estimate_declination",
    "level_floor",
    "preprocess",
    "remove_mixed_pixels",
    "smooth_ranges",
    "thin",
]


@dataclass(frozen=True)
class PreprocessConfig:
    """The steps of `preprocess`.

    Attributes:
        leveling: parameters of the leveling of the floor.
        mixed_pixels: which readings of a log count as mixed.
        smoothing: parameters of the smoothing of the ranges.
        sparse_readings: which points of a log are isolated. Its mixed pixels are found in its scans already, so
            these are points alone in their cell, and few. `preprocess_cloud` keeps those of sparse surfaces.
        sparse_points: which points of a cloud without scans are isolated.
        crop_margin: added below and above a log's box [m].
    """

    leveling: LevelingConfig = field(default_factory=LevelingConfig)
    smoothing: SmoothingConfig = field(default_factory=SmoothingConfig)
    sparse_readings: SparsePointsConfig = field(
        default_factory=lambda: SparsePointsConfig(threshold=2, max_share=0.005, flatness=0.0)
    )
    sparse_points: SparsePointsConfig = field(default_factory=SparsePointsConfig)
    crop_margin: float = 0.05


@overload
def preprocess(  # pyright: ignore[reportOverlappingOverload]
    scans: Cloud,
    *,
    across_jumps: bool | None = None,
    cropped: bool = True,
    progress: Progress = silent,
    config: PreprocessConfig | None = None,
) -> Cloud: ...
@overload
def preprocess(
    scans: ScanLog | ArrayLike,
    *,
    across_jumps: bool | None = None,
    cropped: bool = True,
    progress: Progress = silent,
    config: PreprocessConfig | None = None,
) -> np.ndarray: ...
def preprocess(
    scans: ScanLog | Cloud | ArrayLike,
    *,
    across_jumps: bool | None = None,
    cropped: bool = True,
    progress: Progress = silent,
    config: PreprocessConfig | None = None,
) -> np.ndarray | Cloud:
    """Level, filter and smooth a log, and return its points in the world [m].

    A bare point cloud has no scans to level or smooth; it is filtered by the histogram alone. Of a `Cloud` the points
    that are kept are returned as a cloud, with their colors and viewpoints; of a log with colors the same points as
    without, as a cloud with colors.

    Differs: the paper smooths before it filters. Here mixed pixels are found in the raw readings, before their
    neighbors are averaged with them.

    Args:
        scans: a log, a cloud, or points `[N, 3]` [m].
        across_jumps: average over edges as well, as the paper does; replaces `config.smoothing.across_jumps`.
        cropped: keep only the points in the log's box, where it has one.
        progress: called with the current step.
        config: configuration of the steps.

    Raises:
        ScanError: the points have another shape, or are no numbers.
    """
    config = config or PreprocessConfig()
    if isinstance(scans, Cloud):
        progress("filtering", 0.0)
        return scans.select(~find_sparse_points(scans.points, config.sparse_points))
    if not isinstance(scans, ScanLog):
        progress("filtering", 0.0)
        return remove_mixed_pixels(as_points(scans), config=config)
    log = clean_log(scans, across_jumps=across_jumps, progress=progress, config=config)
    points, colors = log.points(), log.point_colors
    if colors is not None:
        return _select_colored(Cloud(points, colors), log, cropped, config)
    if cropped and scans.box is not None:
        points = crop(points, scans.box, config.crop_margin)
    return points[~find_sparse_points(points, config.sparse_readings)]


def _select_colored(cloud: Cloud, log: ScanLog, cropped: bool, config: PreprocessConfig) -> Cloud:
    """Return those points of a log that `preprocess` keeps, with their colors."""
    if cropped and log.box is not None:
        cloud = crop_cloud(cloud, log.box, config.crop_margin)
    return cloud.select(~find_sparse_points(cloud.points, config.sparse_readings))


def clean_log(
    log: ScanLog,
    *,
    across_jumps: bool | None = None,
    keep_sparse: bool = False,
    progress: Progress = silent,
    config: PreprocessConfig | None = None,
) -> ScanLog:
    """Level a log, drop its mixed readings, and smooth it."""
    config = config or PreprocessConfig()
    progress("leveling", 0.0)
    log = level_floor(log, config=config.leveling)
    progress("filtering", 0.3)
    is_mixed = find_mixed_beams(log.ranges, log.angles)
    if keep_sparse:
        is_mixed &= ~select_needed_beams(log, is_mixed)
    progress("smoothing", 0.6)
    log = log.replace(ranges=np.where(is_mixed, np.nan, log.ranges))
    return smooth_ranges(log, across_jumps=across_jumps, config=config.smoothing)


@overload
def remove_mixed_pixels(scans: ScanLog, *, config: PreprocessConfig | None = None) -> ScanLog: ...
@overload
def remove_mixed_pixels(scans: ArrayLike, *, config: PreprocessConfig | None = None) -> np.ndarray: ...
def remove_mixed_pixels(
    scans: ScanLog | ArrayLike, *, config: PreprocessConfig | None = None
) -> ScanLog | np.ndarray:
    """Drop readings that mix two surfaces: from a log by scan and histogram, from a cloud by histogram alone.

    The scan: see `find_mixed_beams`. The histogram of points in cells of space: see `find_sparse_points`.

    Args:
        scans: a log, or points `[N, 3]` [m].
        config: its `mixed_pixels`, `sparse_readings` and `sparse_points` are used.

    Raises:
        ScanError: the points have another shape, or are no numbers.
    """
    config = config or PreprocessConfig()
    if not isinstance(scans, ScanLog):
        points = as_points(scans)
        return points[~find_sparse_points(points, config.sparse_points)]
    is_mixed = find_mixed_beams(scans.ranges, scans.angles)
    ranges = np.where(is_mixed, np.nan, scans.ranges)
    log = scans.replace(ranges=ranges)
    is_sparse = find_sparse_points(log.points(), config.sparse_readings)
    ranges[log.is_valid] = np.where(is_sparse, np.nan, ranges[log.is_valid])
    return log.replace(ranges=ranges)


NUM_NEIGHBORS = 8  # Readings around a reading that measure the spacing there
REACH = 2.0
"""A reading is lost where no point is nearer than this many spacings: thinning and smoothing lose none."""
MIN_REACH = 0.01
"""Nor is it lost where a point is nearer than this [m]: smoothing moves near readings by more than their spacing."""
NEAREST = 1.0  # Upper limit of the first interval of ranges [m]; each following one reaches twice as far
MIN_TOLD = 0.002
"""Ranges with a smaller share of the readings are not told as the worst: a few readings are soon lost."""
SAMPLE_SIZE = 200_000  # Larger scans are judged by about so many of their readings


@dataclass(frozen=True)
class RangeShare:
    """What was dropped at some ranges.

    Attributes:
        near, far: from which range to which [m].
        num_readings: readings there.
        share: of these, how many were dropped.
    """

    near: float
    far: float
    num_readings: int
    share: float


@dataclass(frozen=True)
class Dropped:
    """The readings that no point is left for."""

    share: float  # of all readings
    by_range: tuple[RangeShare, ...]  # the same by range from the sensor; empty where its position is unknown

    def __str__(self) -> str:
        total = sum(part.num_readings for part in self.by_range)
        told = [part for part in self.by_range if part.num_readings >= MIN_TOLD * total]
        worst = max(told, key=lambda part: part.share, default=None)
        if worst is None or worst.share == 0:
            return f"{100 * self.share:.1f} % of the readings"
        return (
            f"{100 * self.share:.1f} % of the readings; at {worst.near:g} to {worst.far:g} m "
            f"{100 * worst.share:.1f} %"
        )


def measure_dropped(readings: Cloud, points: Float[np.ndarray, "N 3"]) -> Dropped:
    """Return the share of readings that have no point near them, in all and by range."""
    is_dropped, chosen = find_dropped(readings.points, points)
    if not len(chosen):
        return Dropped(0.0, ())
    origins = readings.origins
    if origins is None:
        return Dropped(float(is_dropped.mean()), ())
    ranges = compute_lengths(readings.points[chosen] - origins[chosen])
    steps = np.ceil(np.log2(np.maximum(ranges / NEAREST, 1.0))).astype(np.int64)
    by_range = []
    for step in np.unique(steps):
        here = is_dropped[steps == step]
        near = NEAREST * 2.0 ** (step - 1) if step else 0.0
        by_range.append(RangeShare(float(near), float(NEAREST * 2.0**step), len(here), float(here.mean())))
    return Dropped(float(is_dropped.mean()), tuple(by_range))


def find_dropped(
    readings: Float[np.ndarray, "M 3"], points: Float[np.ndarray, "N 3"]
) -> tuple[Bool[np.ndarray, " S"], np.ndarray]:
    """Return which of a sample of the readings have no point near them, and the indices of the sample."""
    chosen = np.arange(0, len(readings), max(1, len(readings) // SAMPLE_SIZE))
    num_neighbors = min(NUM_NEIGHBORS, len(readings) - 1)
    if num_neighbors < 1 or not len(points):
        return np.full(len(chosen), not len(points)), chosen
    reach = cKDTree(readings).query(readings[chosen], k=num_neighbors + 1)[0][:, -1]
    spacing = reach * np.sqrt(np.pi / num_neighbors)
    distance = cKDTree(points).query(readings[chosen])[0]
    return distance > np.maximum(REACH * spacing, MIN_REACH), chosen


def preprocess_cloud(source: ScanLog | Cloud, config: PreprocessConfig | None = None) -> Cloud:
    """Level, filter and smooth a log, or filter a cloud; return the points that are left as a cloud.

    Of a log these are the points of `preprocess`, and those that sparse surfaces need (`select_needed_beams`): far
    walls, and walls at a low angle. The arenas of this project are made with `preprocess`.

    Args:
        source: a log, or a cloud [m].
        config: configuration of the steps.
    """
    config = config or PreprocessConfig()
    if isinstance(source, Cloud):
        return source.select(~find_sparse_points(source.points, config.sparse_points))
    log = clean_log(source, keep_sparse=True, config=config)
    cloud = make_log_cloud(log)
    if log.box is not None:
        cloud = crop_cloud(cloud, log.box, config.crop_margin)
    sparse = replace(config.sparse_readings, flatness=config.sparse_points.flatness)
    return cloud.select(~find_sparse_points(cloud.points, sparse))


def read_rays(
    log: ScanLog, config: PreprocessConfig | None = None
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Level, filter and smooth a log; return its points, and the position of the sensor at each [m]."""
    return read_colored_rays(log, config)[:2]


def read_colored_rays(
    log: ScanLog, config: PreprocessConfig | None = None
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"], UInt8[np.ndarray, "N 3"] | None]:
    """Return the points and origins of `read_rays`, and the colors of the points where the log has a camera's."""
    config = config or PreprocessConfig()
    log = remove_mixed_pixels(level_floor(log, config=config.leveling), config=config)
    log = smooth_ranges(log, config=config.smoothing)
    points = log.points()
    sensors = np.broadcast_to(log.poses[:, None, :3, 3], (*log.ranges.shape, 3))
    origins = sensors[log.is_valid]
    colors = log.point_colors
    if log.box is None:
        return points, origins, colors
    is_inside = ((points >= log.box[0]) & (points <= log.box[1])).all(axis=1)
    return points[is_inside], origins[is_inside], None if colors is None else colors[is_inside]
