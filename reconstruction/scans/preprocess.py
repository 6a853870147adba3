"""Levelling, smoothing and filtering of laser scans (paper, section II-A), composed."""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.progress import Progress, silent
from reconstruction.scans.cells import as_points, crop, find_sparse_points, thin
from reconstruction.scans.levelling import find_declination, level_floor
from reconstruction.scans.mixed_pixels import find_mixed_beams, find_step
from reconstruction.scans.scan import Array, ScanLog
from reconstruction.scans.smoothing import smooth_ranges

__all__ = [
    "crop",
    "find_declination",
    "level_floor",
    "preprocess",
    "remove_mixed_pixels",
    "smooth_ranges",
    "thin",
]

_ALONE, _SPARSE_SHARE = 2, 0.005
"""A log's mixed pixels are found by their scans; the histogram takes points that are alone
in their cell, at most this share."""


def preprocess(
    scans: ScanLog | ArrayLike,
    *,
    across_jumps: bool = False,
    cropped: bool = True,
    progress: Progress = silent,
) -> Array:
    """Level, filter and smooth a log, and return its points in the world, `[N, 3]` [m].

    A bare point cloud has no scans to level or smooth; it is filtered by the histogram alone.

    Differs: the paper smooths before it filters. Here mixed pixels are found in the readings as they came,
    before their neighbours are averaged with them.

    Args:
        scans: a log, or points `[N, 3]` [m].
        across_jumps: average over edges as well, as the paper does.
        cropped: keep only what lies in the log's box, where it has one.
        progress: called with what is being done.

    Raises:
        ScanError: the points have another shape.
    """
    if not isinstance(scans, ScanLog):
        progress("filtering", 0.0)
        return remove_mixed_pixels(as_points(scans))
    progress("levelling", 0.0)
    log = level_floor(scans)
    progress("filtering", 0.3)
    is_mixed = find_mixed_beams(log.ranges, step=find_step(log.angles))
    progress("smoothing", 0.6)
    log = smooth_ranges(log.replace(ranges=np.where(is_mixed, np.nan, log.ranges)), across_jumps=across_jumps)
    points = log.points()
    if cropped and log.box is not None:
        points = crop(points, log.box)
    return points[~find_sparse_points(points, threshold=_ALONE, max_share=_SPARSE_SHARE)]


@overload
def remove_mixed_pixels(scans: ScanLog) -> ScanLog: ...
@overload
def remove_mixed_pixels(scans: ArrayLike) -> Array: ...
def remove_mixed_pixels(scans: ScanLog | ArrayLike) -> ScanLog | Array:
    """Drop readings that mix two surfaces: from a log by scan and histogram, from a cloud by histogram alone.

    The scan: see `find_mixed_beams`. The histogram of points in cells of space: see `find_sparse_points`.
    """
    if not isinstance(scans, ScanLog):
        points = as_points(scans)
        return points[~find_sparse_points(points)]
    ranges = np.where(find_mixed_beams(scans.ranges, step=find_step(scans.angles)), np.nan, scans.ranges)
    log = scans.replace(ranges=ranges)
    ranges[log.is_valid] = np.where(
        find_sparse_points(log.points(), threshold=_ALONE, max_share=_SPARSE_SHARE),
        np.nan,
        ranges[log.is_valid],
    )
    return log.replace(ranges=ranges)
