"""Leveling, smoothing and filtering of laser scans (paper, section II-A), composed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.scans import selection
from reconstruction._src.scans.cells import SparsePointsConfig, as_points, crop, find_sparse_points, thin
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.leveling import LevelingConfig, find_declination, level_floor
from reconstruction._src.scans.mixed_pixels import MixedPixelsConfig, find_mixed_beams, find_needed_beams
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.smoothing import SmoothingConfig, smooth_ranges

__all__ = [
    "PreprocessConfig",
    "crop",
    "find_declination",
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
    mixed_pixels: MixedPixelsConfig = field(default_factory=MixedPixelsConfig)
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
        cloud = selection.crop(cloud, log.box, config.crop_margin)
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
    is_mixed = find_mixed_beams(log.ranges, log.angles, config.mixed_pixels)
    if keep_sparse:
        is_mixed &= ~find_needed_beams(log, is_mixed, config.mixed_pixels)
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
    is_mixed = find_mixed_beams(scans.ranges, scans.angles, config.mixed_pixels)
    ranges = np.where(is_mixed, np.nan, scans.ranges)
    log = scans.replace(ranges=ranges)
    is_sparse = find_sparse_points(log.points(), config.sparse_readings)
    ranges[log.is_valid] = np.where(is_sparse, np.nan, ranges[log.is_valid])
    return log.replace(ranges=ranges)
