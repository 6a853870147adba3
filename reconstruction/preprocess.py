"""Levelling, smoothing and filtering of laser scans (paper, section II-A)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.errors import ScanError
from reconstruction.progress import Progress, silent
from reconstruction.scan import Array, ScanLog

JUMP = 0.04
"""Range difference between neighbouring beams that no surface explains [m]."""


def preprocess(
    scans: ScanLog | ArrayLike,
    *,
    smooth_across_jumps: bool = False,
    cropped: bool = True,
    progress: Progress = silent,
) -> Array:
    """Level, smooth and filter a log, and return its points in the world, `[N, 3]` [m].

    A bare point cloud has no scans to level or smooth; it is only filtered.

    Args:
        scans: a log, or points `[N, 3]`.
        smooth_across_jumps: average as the paper does, over edges as well.
        cropped: keep only what lies in the log's box.
        progress: called with what is being done.
    """
    if not isinstance(scans, ScanLog):
        return remove_mixed_pixels(as_points(scans))
    progress("levelling", 0.0)
    log = level_floor(scans)
    progress("smoothing", 0.3)
    keep = find_clean_beams(log)
    log = smooth_ranges(log, across_jumps=smooth_across_jumps)
    progress("filtering", 0.6)
    log = log.replace(ranges=np.where(keep, log.ranges, np.nan))
    points = log.points()
    return crop(points, log.box) if cropped and log.box is not None else points


def level_floor(log: ScanLog, max_tilt: float = np.radians(4.0), tolerance: float = 0.03) -> ScanLog:
    """Turn every vertical scan about the robot's foot so that its floor segment is level."""
    return log.replace(poses=_turn(log, -find_declination(log, max_tilt, tolerance)))


def find_declination(log: ScanLog, max_tilt: float = np.radians(4.0), tolerance: float = 0.03) -> Array:
    """Find the declination of the floor's line in every scan, `[S]` [rad], seen along the scan's normal."""
    u, v = _plane_coordinates(log)
    slope = np.where(np.abs(u) > 0.2, v / u, np.nan)
    weight = np.where(np.abs(slope) < np.tan(max_tilt), np.minimum(np.abs(u), 1.0), 0.0)
    bins = 40
    index = np.nan_to_num((slope / np.tan(max_tilt) + 1) / 2 * bins).clip(0, bins - 1).astype(np.int64)
    index += bins * np.arange(len(u))[:, None]
    votes = np.bincount(index.ravel(), np.nan_to_num(weight).ravel(), minlength=bins * len(u)).reshape(
        -1, bins
    )
    votes[:, 1:-1] += 0.5 * (votes[:, :-2] + votes[:, 2:])
    tangent = ((votes.argmax(axis=1) + 0.5) / bins * 2 - 1) * np.tan(max_tilt)
    for scale in (2.0, 1.0, 1.0, 1.0):
        residual = v - tangent[:, None] * u
        w = np.clip(1 - (residual / (scale * tolerance)) ** 2, 0, None) ** 2
        w = np.nan_to_num(w)
        total = (w * np.nan_to_num(u) ** 2).sum(1)
        new = (w * np.nan_to_num(u * v)).sum(1) / np.maximum(total, 1e-12)
        tangent = np.where(total > 1e-6, new, tangent)
    return np.arctan(tangent)


def _plane_coordinates(log: ScanLog) -> tuple[Array, Array]:
    """Coordinates in the robot, in the plane of the scan: to the side and up, each `[S, B]`."""
    side, up = _plane_axes(log)
    planar = np.stack([np.cos(log.angles), np.sin(log.angles)])
    rows = np.stack([side, up]) @ log.mount[:3, :2] @ planar
    offset = np.stack([side, up]) @ log.mount[:3, 3]
    return log.ranges * rows[0] + offset[0], log.ranges * rows[1] + offset[1]


def _plane_axes(log: ScanLog) -> tuple[Array, Array]:
    normal = log.mount[:3, 2]
    side = np.cross([0.0, 0.0, 1.0], normal)
    side /= np.linalg.norm(side)
    return side, np.cross(normal, side)


def _turn(log: ScanLog, angle: Array) -> Array:
    """Turn the poses by angles `[S]` about the scan's normal through the robot's origin."""
    side, up = _plane_axes(log)
    normal = np.cross(side, up)
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    outer = np.outer(normal, normal)
    cross = np.array([[0, -normal[2], normal[1]], [normal[2], 0, -normal[0]], [-normal[1], normal[0], 0]])
    turn = np.zeros((len(angle), 4, 4))
    turn[:, :3, :3] = c * (np.eye(3) - outer) + outer + s * cross
    turn[:, 3, 3] = 1
    return log.poses @ np.linalg.inv(log.mount) @ turn @ log.mount


def find_jumps(ranges: Array, jump: float = JUMP) -> NDArray[np.bool_]:
    """Find where two neighbouring beams do not lie on one surface, `[S, B - 1]`."""
    q = 1.0 / ranges
    step = np.diff(q, axis=1)
    padded = np.pad(step, ((0, 0), (2, 2)), constant_values=np.nan)
    windows = np.stack([padded[:, k : k + step.shape[1]] for k in range(5)])
    middle = np.nanmedian(windows, axis=0)
    excess = np.abs(step - middle) * ranges[:, 1:] * ranges[:, :-1]
    return ~(excess <= jump)


def smooth_ranges(log: ScanLog, window: int = 5, across_jumps: bool = False) -> ScanLog:
    """Average every reading with its neighbours in the scan."""
    half = window // 2
    ranges, good = log.ranges, log.is_valid
    total, count = np.where(good, ranges, 0.0), good.astype(float)
    joined = np.ones_like(find_jumps(ranges)) if across_jumps else ~find_jumps(ranges)
    linked = np.ones_like(joined)
    total0 = total.copy()
    valid0 = good.astype(float)
    for k in range(1, half + 1):
        linked = joined[:, k - 1 :] & (linked[:, :-1] if k > 1 else linked)
        w = linked * valid0[:, k:] * valid0[:, :-k]
        total[:, :-k] += w * total0[:, k:]
        count[:, :-k] += w
        total[:, k:] += w * total0[:, :-k]
        count[:, k:] += w
    return log.replace(ranges=np.where(good, total / np.maximum(count, 1), np.nan))


def find_clean_beams(log: ScanLog) -> NDArray[np.bool_]:
    """Find the beams that met one surface, `[S, B]`."""
    jumps = np.pad(find_jumps(log.ranges), ((0, 0), (1, 1)), constant_values=False)
    return log.is_valid & ~(jumps[:, 1:] | jumps[:, :-1])


def remove_mixed_pixels(scans: ScanLog | Array):
    """Drop points of cells that hold too few (a 3-D histogram)."""
    if isinstance(scans, ScanLog):
        return scans.replace(ranges=np.where(find_clean_beams(scans), scans.ranges, np.nan))
    return scans


def crop(points: ArrayLike, box: ArrayLike) -> Array:
    """Keep the points in a box `[[lowest], [highest]]` [m]; x and y are cut sharply, z with 5 cm to spare."""
    points = as_points(points)
    low, high = np.asarray(box, float)
    return points[((points >= low - [0, 0, 0.05]) & (points <= high + [0, 0, 0.05])).all(axis=1)]


def thin(points: ArrayLike, voxel: float) -> Array:
    """Replace the points of every cube of the edge `voxel` [m] by their mean."""
    points = as_points(points)
    cell = np.floor((points - points.min(axis=0)) / voxel).astype(np.int64)
    size = cell.max(axis=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    _, index, counts = np.unique(key, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(index, points[:, k]) / counts for k in range(3)], axis=1)


def as_points(points: ArrayLike) -> Array:
    """Check that these are points `[N, 3]`; rows that are not finite are dropped."""
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ScanError(f"points must have shape [N, 3], not {points.shape}")
    return points[np.isfinite(points).all(axis=1)]
