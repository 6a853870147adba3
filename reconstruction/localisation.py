"""Where the robot was: odometry corrected by matching its horizontal scans (paper, section II-A)."""

from __future__ import annotations

import numpy as np
import small_gicp

from reconstruction.errors import ScanError
from reconstruction.progress import Progress, silent
from reconstruction.scan import Array, HorizontalScans, ScanLog, make_pose, planar_pose

_LAYERS = np.array([-0.06, 0.0, 0.06])
"""A scan is drawn at three heights, so that a wall's covariance is a wall's in 3-D."""


def localise(log: ScanLog, progress: Progress = silent) -> ScanLog:
    """Return the log with poses from scan matching, and with the errors in its report where the truth is known.

    Every horizontal scan is matched (GICP) to a map of earlier key scans, starting where the odometry says; then all of
    them once more to the finished map. Three degrees of freedom, x, y and yaw, are kept.

    Raises:
        ScanError: the log has no horizontal scans.
    """
    if log.horizontal is None:
        raise ScanError(
            "the log has no horizontal scans to localise the robot by; give poses with the ScanLog"
        )
    ground = (log.poses @ np.linalg.inv(log.mount))[0, 2, 3] if len(log.poses) else 0.0
    planar = match_scans(log.horizontal, progress=progress)
    robot = make_pose(*planar.T)
    robot[:, 2, 3] = ground
    report = dict(log.report)
    if log.truth is not None:
        report |= judge_localisation(planar, planar_pose(log.truth.robot_poses))
    return log.replace(poses=robot @ log.mount, report=report)


def judge_localisation(planar: Array, true: Array) -> dict[str, float]:
    """Compare poses `[S, 3]` (x, y, yaw) with the true ones: largest and median error [m] and [deg]."""
    distance = np.hypot(*(planar - true)[:, :2].T)
    angle = np.degrees(np.abs((planar[:, 2] - true[:, 2] + np.pi) % (2 * np.pi) - np.pi))
    return {
        "localisation_max": float(distance.max()),
        "localisation_median": float(np.median(distance)),
        "localisation_max_deg": float(angle.max()),
        "localisation_median_deg": float(np.median(angle)),
    }


def match_scans(
    scans: HorizontalScans, key_distance: float = 0.4, key_angle: float = 0.35, progress: Progress = silent
) -> Array:
    """Match horizontal scans to a growing map, then to the finished one; returns x, y, yaw `[S, 3]` in the world."""
    count = len(scans.ranges)
    planar = np.empty((count, 3))
    planar[:1] = scans.start
    points = [_scan_points(scans, i) for i in range(count)]
    keys = [0]
    target = _make_map([_move(points[0], planar[0])])
    for i in range(1, count):
        guess = _compose(planar[i - 1], _between(scans.odometry[i - 1], scans.odometry[i]))
        planar[i] = _align(target, points[i], guess)
        step = planar[i] - planar[keys[-1]]
        if np.hypot(*step[:2]) > key_distance or abs(step[2]) > key_angle:
            keys.append(i)
            target = _make_map([_move(points[k], planar[k]) for k in keys])
        if i % 50 == 0:
            progress("localising", 0.5 * i / count)
    target = _make_map([_move(points[k], planar[k]) for k in keys])
    for i in range(count):
        planar[i] = _align(target, points[i], planar[i])
        if i % 50 == 0:
            progress("localising", 0.5 + 0.5 * i / count)
    return planar


def _scan_points(scans: HorizontalScans, i: int) -> Array:
    ranges = scans.ranges[i]
    good = np.isfinite(ranges)
    ends = np.stack([ranges * np.cos(scans.angles), ranges * np.sin(scans.angles)], axis=1)[good]
    return ends @ scans.mount[:2, :2].T + scans.mount[:2, 3]


def _move(points: Array, planar: Array) -> Array:
    c, s = np.cos(planar[2]), np.sin(planar[2])
    return points @ np.array([[c, s], [-s, c]]) + planar[:2]


def _compose(planar: Array, step: Array) -> Array:
    return np.append(_move(step[None, :2], planar)[0], planar[2] + step[2])


def _between(a: Array, b: Array) -> Array:
    c, s = np.cos(a[2]), np.sin(a[2])
    return np.array([c * (b - a)[0] + s * (b - a)[1], -s * (b - a)[0] + c * (b - a)[1], b[2] - a[2]])


def _raise(points: Array) -> Array:
    return np.concatenate([np.c_[points, np.full(len(points), z)] for z in _LAYERS])


def _make_map(scans: list[Array]) -> tuple:
    cloud = small_gicp.PointCloud(_raise(_thin(np.concatenate(scans), 0.03)))
    tree = small_gicp.KdTree(cloud)
    small_gicp.estimate_covariances(cloud, tree, num_neighbors=15)
    return cloud, tree


def _thin(points: Array, cell: float) -> Array:
    _, index, counts = np.unique(
        np.floor(points / cell).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    index = index.ravel()
    return np.stack([np.bincount(index, points[:, k]) / counts for k in range(2)], axis=1)


def _align(target: tuple, points: Array, guess: Array) -> Array:
    source = small_gicp.PointCloud(_raise(points))
    small_gicp.estimate_covariances(source, small_gicp.KdTree(source), num_neighbors=10)
    result = small_gicp.align(
        target[0], source, target[1], make_pose(*guess), max_correspondence_distance=0.15,
        rotation_epsilon=1e-5, translation_epsilon=1e-5, max_iterations=20,
    )  # fmt: skip
    planar = planar_pose(result.T_target_source[None])[0]
    planar[2] = guess[2] + (planar[2] - guess[2] + np.pi) % (2 * np.pi) - np.pi
    return planar
