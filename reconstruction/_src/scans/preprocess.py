"""Leveling, smoothing and filtering of laser scans (paper, section II-A), composed."""

from __future__ import annotations

from typing import overload

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import make_log_cloud
from reconstruction._src.scans.leveling import level_floor
from reconstruction._src.scans.mixed_pixels import find_jumps, find_mixed_beams, select_needed_beams
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.selection import as_points, find_sparse_points

_SPARSE_READINGS = 2, 0.005
"""Points in a cell and share of the points below which readings of a log are isolated. Its mixed pixels are found in
its scans already, so these are points alone in their cell, and few."""
_CREASE, _CREASE_PER_METER = 0.03, 0.004
"""Least bend of a surface that ends the window of smoothing, at range 0 [m], and its growth with the range: several
times the noise of the bend."""
_NUM_NEIGHBORS = 8  # Readings around a reading that measure the spacing there
_REACH = 2.0  # A reading is lost where no point is nearer than so many spacings: thinning loses none
_MIN_REACH = 0.01  # Nor where a point is nearer than this [m]: smoothing moves near readings by more
_SAMPLE_SIZE = 200_000  # Larger scans are judged by about so many of their readings


@overload
def preprocess(scans: Cloud, *, progress: Progress = silent) -> Cloud: ...  # pyright: ignore[reportOverlappingOverload]
@overload
def preprocess(scans: ScanLog | ArrayLike, *, progress: Progress = silent) -> np.ndarray: ...
def preprocess(scans: ScanLog | Cloud | ArrayLike, *, progress: Progress = silent) -> np.ndarray | Cloud:
    """Level, filter and smooth a log, and return its points in the world [m], cropped to its box where it has one.

    A bare point cloud has no scans to level or smooth; it is filtered by the histogram alone. Of a `Cloud` the points
    that are kept are returned as a cloud, with their colors and viewpoints; of a log with colors the same points as
    without, as a cloud with colors.

    Differs: the paper smooths before it filters. Here mixed pixels are found in the raw readings, before their
    neighbors are averaged with them.

    Args:
        scans: a log, a cloud, or points `[N, 3]` [m].
        progress: called with the current step.

    Raises:
        ScanError: the points have another shape, or are no numbers.
    """
    if isinstance(scans, ScanLog):
        cloud = _clean_log(scans, False, progress)
        return cloud.points if cloud.colors is None else Cloud(cloud.points, cloud.colors)
    progress("filtering", 0.0)
    if isinstance(scans, Cloud):
        return scans.select(~find_sparse_points(scans.points))
    points = as_points(scans)
    return points[~find_sparse_points(points)]


def preprocess_cloud(source: ScanLog | Cloud) -> Cloud:
    """Level, filter and smooth a log, or filter a cloud; return the points that are left as a cloud.

    Of a log these are the points of `preprocess`, and those that sparse surfaces need: far walls, and walls at a low
    angle. The arenas of this project are made with `preprocess`.

    Args:
        source: a log, or a cloud [m].
    """
    return preprocess(source) if isinstance(source, Cloud) else _clean_log(source, True, silent)


def _clean_log(log: ScanLog, keep_sparse: bool, progress: Progress) -> Cloud:
    """Return the points of a log that are left after all steps; with those that sparse surfaces need, if wanted."""
    progress("leveling", 0.0)
    log = level_floor(log)
    progress("filtering", 0.3)
    is_mixed = find_mixed_beams(log.ranges, log.angles)
    if keep_sparse:
        is_mixed &= ~select_needed_beams(log, is_mixed)
    progress("smoothing", 0.6)
    cloud = make_log_cloud(smooth_ranges(log.replace(ranges=np.where(is_mixed, np.nan, log.ranges))))
    return cloud.select(~find_sparse_points(cloud.points, *_SPARSE_READINGS, keep_flat=keep_sparse))


def remove_mixed_pixels(log: ScanLog) -> ScanLog:
    """Drop readings that mix two surfaces: those of beams at edges, by scan, and isolated ones, by a histogram.

    The scan: see `find_mixed_beams`. The histogram of points in cells of space: see `find_sparse_points`. A cloud
    without scans is filtered by `preprocess`.
    """
    ranges = np.where(find_mixed_beams(log.ranges, log.angles), np.nan, log.ranges)
    log = log.replace(ranges=ranges)
    is_sparse = find_sparse_points(log.points(), *_SPARSE_READINGS, keep_flat=False)
    ranges[log.is_valid] = np.where(is_sparse, np.nan, ranges[log.is_valid])
    return log.replace(ranges=ranges)


def smooth_ranges(log: ScanLog, window: int = 5) -> ScanLog:
    """Average every reading with its neighbors in the scan: ``r_i <- mean(r_(i-2) .. r_(i+2))`` for a window of 5.

    Differs: the paper averages all readings in the window. Here the window shrinks, on both sides alike (a mean
    over a slanted surface is right only where it is symmetric), until it holds no jump (`find_jumps`), no beam
    without return, and no crease (`find_creases`) except at its ends. And it is the harmonic mean, which is exact on
    planes: ``1/r`` is ``cos(a - a0) / d``.

    Args:
        log: the scans.
        window: number of readings; 1 changes nothing. 5 is the paper's.

    Raises:
        ScanError: the window is not odd and above 0.
    """
    if window < 1 or window % 2 == 0:
        raise ScanError(f"window must be odd and above 0, got {window}")
    good, num_beams = log.is_valid, log.ranges.shape[1]
    linked = good[:, 1:] & good[:, :-1] & ~find_jumps(log.ranges)
    is_passable = ~find_creases(log.ranges)
    inverse = np.where(good, 1.0 / log.ranges, 0.0)
    total, count, reaches = inverse.copy(), np.ones(good.shape), good.copy()
    for k in range(1, min(window // 2, (num_beams - 1) // 2) + 1):
        rest = num_beams - 2 * k
        step = linked[:, :rest] & linked[:, 2 * k - 1 :]
        step &= is_passable[:, 1 : rest + 1] & is_passable[:, 2 * k - 1 : num_beams - 1]
        reaches = np.pad(reaches[:, k : num_beams - k] & step, ((0, 0), (k, k)))
        both = inverse[:, :rest] + inverse[:, 2 * k :]
        total[:, k : num_beams - k] += np.where(reaches[:, k : num_beams - k], both, 0.0)
        count += 2 * reaches
    with np.errstate(divide="ignore"):
        return log.replace(ranges=np.where(good, 1.0 / (total / count), np.nan))


def find_creases(ranges: Float[np.ndarray, "S B"]) -> Bool[np.ndarray, "S B"]:
    """Find the beams where two surfaces meet without a jump.

    On a plane 1/r bends little: ``c_i = r_i^2 |q_(i+2) - 2 q_i + q_(i-2)|``, ``q = 1/r``, is mere noise. A crease is
    where c_i exceeds ``crease + crease_per_meter r_i`` and both its neighbors.
    """
    bend = np.zeros(ranges.shape)
    if ranges.shape[1] >= 5:
        inverse = 1.0 / ranges
        bend[:, 2:-2] = np.abs(inverse[:, 4:] - 2 * inverse[:, 2:-2] + inverse[:, :-4]) * ranges[:, 2:-2] ** 2
        np.nan_to_num(bend, copy=False)
    highest = np.pad(bend, ((0, 0), (1, 1)))
    is_bent = bend > _CREASE + _CREASE_PER_METER * ranges
    return is_bent & (bend >= highest[:, :-2]) & (bend >= highest[:, 2:])


def measure_dropped(readings: Float[np.ndarray, "M 3"], points: Float[np.ndarray, "N 3"]) -> float:
    """Return the share of readings, of a sample of them, that have no point near them."""
    if not len(readings):
        return 0.0
    chosen = readings[:: max(1, len(readings) // _SAMPLE_SIZE)]
    num_neighbors = min(_NUM_NEIGHBORS, len(readings) - 1)
    if num_neighbors < 1 or not len(points):
        return float(not len(points))
    reach = cKDTree(readings).query(chosen, k=num_neighbors + 1)[0][:, -1]
    spacing = reach * np.sqrt(np.pi / num_neighbors)
    distance = cKDTree(points).query(chosen)[0]
    return float(np.mean(distance > np.maximum(_REACH * spacing, _MIN_REACH)))
