"""Levelling: the robot shakes, the floor does not (paper, section II-A)."""

from __future__ import annotations

import numpy as np

from reconstruction.scans.scan import Array, ScanLog

_MAX_LEAN = 0.3
"""A scan plane counts as vertical where its normal rises by less than this."""
_NUM_BINS = 40


def level_floor(log: ScanLog, max_tilt: float = np.radians(4.0), tolerance: float = 0.03) -> ScanLog:
    """Turn every vertical scan so that its floor is level: ``T <- T_robot R(n, -delta) T_mount``.

    delta is the declination of the floor's line in the scan (`find_declination`), n the scan plane's normal.
    The turn is about the robot's foot, where it touches the ground, so a sensor on a mast moves sideways as
    it did; a log without `mount` is turned about the sensor.

    This sees the lean within the scan's plane, and on a level floor nothing else: leaning across its plane by p,
    the scan meets the same floor in the same line, at the same ranges. What is h above the floor, it shows h sin(p)
    off its place across the plane. Where a horizontal scanner localises the robot, its sway tells p roughly
    (`reconstruction.scans.localisation.find_pitch`); the rest stays.

    Args:
        log: scans; those that are not vertical, or show no floor, are left as they are.
        max_tilt: largest declination looked for [rad].
        tolerance: how far readings may lie from the floor's line [m].
    """
    turn = find_lean(log, max_tilt, tolerance)
    return log.replace(poses=log.poses @ np.linalg.inv(log.mount) @ turn @ log.mount)


def find_lean(log: ScanLog, max_tilt: float = np.radians(4.0), tolerance: float = 0.03) -> Array:
    """Find how the robot leans in the plane of every scan: ``R(n, -delta)`` of `level_floor`, `[S, 4, 4]`."""
    angle = find_declination(log, max_tilt, tolerance)
    turn = np.tile(np.eye(4), (len(angle), 1, 1))
    if angle.any():
        turn[:, :3, :3] = _rotations(np.cross(*_plane_axes(log.mount)), -angle)
    return turn


def find_declination(log: ScanLog, max_tilt: float = np.radians(4.0), tolerance: float = 0.03) -> Array:
    """Find the declination of the floor's line in every scan, `[S]` [rad]; 0 where no floor is seen.

    With (u, v) a reading's place to the side of the robot's foot and above it, the floor is the line
    ``v = u tan(delta)``. Readings vote for v/u with weight min(|u|, 1 m); from the best bin, tan(delta) is
    refined as ``sum(w u v) / sum(w u^2)`` with Tukey's weights ``w = (1 - (residual / tolerance)^2)^2``.

    A log without `mount` has its foot found first: under the sensor, at the height of most readings.
    """
    if len(log.ranges) == 0 or not _is_vertical(log):
        return np.zeros(len(log.ranges))
    u, v = _plane_coordinates(log)
    limit = np.tan(max_tilt)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (v / u / limit + 1) * (_NUM_BINS / 2)
    votes = np.abs(u) > 0.2
    votes &= (share > 0) & (share < _NUM_BINS)
    scan, _ = np.nonzero(votes)
    bins = share[votes].astype(np.int64) + _NUM_BINS * scan
    weight = np.minimum(np.abs(u[votes]), 1.0)
    table = np.bincount(bins, weight, minlength=_NUM_BINS * len(u)).reshape(len(u), _NUM_BINS).astype(float)
    spread = table.copy()
    spread[:, 1:] += 0.5 * table[:, :-1]
    spread[:, :-1] += 0.5 * table[:, 1:]
    tangent = ((spread.argmax(axis=1) + 0.5) / _NUM_BINS * 2 - 1) * limit
    tangent[spread.max(axis=1) == 0] = 0.0
    votes = np.abs(v) < 2 * limit * np.abs(u) + tolerance
    scan, _ = np.nonzero(votes)
    u, v = u[votes], v[votes]
    for scale in (2.0, 1.0, 1.0, 1.0):
        residual = (v - tangent[scan] * u) / (scale * tolerance)
        w = np.maximum(1.0 - residual * residual, 0.0)
        w *= w * u
        total = np.bincount(scan, w * u, minlength=len(tangent))
        pull = np.bincount(scan, w * v, minlength=len(tangent))
        tangent = np.where(total > 1e-3, pull / np.maximum(total, 1e-12), tangent)
    return np.arctan(np.clip(tangent, -limit, limit))


def _plane_coordinates(log: ScanLog) -> tuple[Array, Array]:
    """To the side of the foot and above it, in the plane of the scan, each `[S, B]`."""
    axes = np.stack(_plane_axes(log.mount))
    rows = axes @ log.mount[:3, :2] @ np.stack([np.cos(log.angles), np.sin(log.angles)])
    offset = axes @ log.mount[:3, 3]
    u, v = log.ranges * rows[0] + offset[0], log.ranges * rows[1] + offset[1]
    if not np.any(log.mount[:3, 3]):
        v = v - _find_floor(v)
    return u, v


def _find_floor(heights: Array, bin_width: float = 0.02) -> float:
    """Height at which most readings lie below the sensor; the lowest one that comes near."""
    low = heights[heights < 0]
    if not low.size:
        return 0.0
    counts = np.bincount(((low - low.min()) / bin_width).astype(np.int64))
    counts = np.convolve(counts, [1, 1, 1], "same")
    first = int(np.argmax(counts >= 0.5 * counts.max()))
    first += int(np.argmax(counts[first : first + 5]))
    peak = low.min() + (first + 0.5) * bin_width
    return float(low[np.abs(low - peak) < 2 * bin_width].mean())


def _is_vertical(log: ScanLog) -> bool:
    """Whether the scan plane stands on the ground, in the robot and in the world."""
    world = np.abs(log.poses[:, 2, 2])
    return bool(np.abs(log.mount[2, 2]) < _MAX_LEAN and np.median(world) < _MAX_LEAN)


def _plane_axes(mount: Array) -> tuple[Array, Array]:
    """The scan plane's horizontal and rising direction, in the robot."""
    normal = mount[:3, 2]
    side = np.cross([0.0, 0.0, 1.0], normal)
    side /= np.linalg.norm(side)
    return side, np.cross(normal, side)


def _rotations(axis: Array, angles: Array) -> Array:
    """Rodrigues' formula, `[S, 3, 3]`."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    c, s = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    return c * np.eye(3) + s * cross + (1 - c) * np.outer(axis, axis)
