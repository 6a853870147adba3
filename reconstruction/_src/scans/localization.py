"""Localization of the robot: odometry corrected by matching its horizontal scans (paper, section II-A) to a map of
walls that is made of them (point to plane, small_gicp).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import solveh_banded
from scipy.spatial import KDTree

from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.pose import (
    compose_planar,
    compute_planar_step,
    make_pose,
    rotate_planar,
    to_planar,
    transform_planar,
)
from reconstruction._src.scans.leveling import LEAST_SCANS, compute_tilt, estimate_declination, estimate_shake
from reconstruction._src.scans.mixed_pixels import find_jumps
from reconstruction._src.scans.scan import HorizontalScans, ScanLog

if TYPE_CHECKING:
    from small_gicp import KdTree, PointCloud

_LEAST_SHAKE = 1e-5  # A robot that does not sway keeps the weights finite [rad]
_MATCH_ERROR = 0.001  # Standard deviation of the position of a scan matched to the final map [m]
_MIN_HEIGHT = 0.1  # A scanner below this height [m] shows no pitch: it sways less than matching errs
_MAX_PITCH = 0.1  # Largest sine of the pitch: more is a wrong match

_PLANAR = [3, 4, 2]  # x, y and the turn about z among the six parameters of a match (turns first)
_FIRST_PASS, _SETTLING = 0.4, 0.3  # Shares of the time, for the progress
_PROGRESS_INTERVAL = 50  # Scans between two reports of progress
_NUM_ROUNDS = 8  # Times that the map is made again from the matched scans; its loop closes in 8
_KEY_DISTANCE = 0.4  # A scan becomes part of the map where the robot has gone on by this [m] ..
_KEY_ANGLE = 0.35  # ... or has turned by this [rad].
_MAX_KEYS = 400  # Scans that the final map is made of, about: more take longer and change little
_FIRST_REACH = 0.15  # Reach of a reading to its wall in the first pass [m]: the error of the odometry
_REACH = 0.06  # The same in later passes, where poses are good to centimeters [m]
_MAP_CELL = 0.03  # Edge of the cells in which the readings of the map are averaged [m]
_LINE_REACH = 0.15  # Points of the map within this distance [m] make a line
_LINE_POINTS = 12  # Points that make a line
_MAX_FLATNESS = 0.05  # Points are on a line with less variance across it than this share of that along it
_MIN_LINE_READINGS = 3  # Readings that a line has at least
_MIN_MAP_POINTS = 20  # A map of fewer points is not used
_LAYER_HEIGHT = 0.04  # The map has three layers, this far apart [m], so that a wall is a plane in 3-D as well
_NORMAL_POINTS = 15  # Points that the normal of the map's planes is found from
_READING_NOISE = 0.05  # Of a reading in a match [m]: errors of neighbors are correlated
_GUESS_INFORMATION = np.diag([1e4, 1e4, 2500.0])  # Inverse covariance of a guess: 0.01 m and 0.02 rad
_MAX_ITERATIONS = 15  # Largest number of iterations of a match
_TRANSLATION_TOLERANCE = 0.0001  # A match has converged where it moves the scan by less than this [m] ..
_ROTATION_TOLERANCE = 1e-05  # ... and turns it by less than this [rad].

_UNKNOWN_SLIP = 0.01  # Of wheels after 1 m where nothing is known [m]: tracks on carpet or gravel
_LAGS = (5, 10, 20, 40)  # Scans between compared poses: beyond the memory of the sway
_MIN_VARIANCE = 1e-10  # Of a step [m^2]: wheels that stand err by 0.01 mm, which keeps the weights finite
_MIN_SQUARED_WAY = 1e-6  # Least sum of squared ways [m^2] that tells a scale: a robot that stands has none
_YAW_NOISE = 0.0006  # Standard deviation of the matched yaw [rad], in a room of 10 m
_TURN_WAY = 0.2  # Way [m] that a turn of one radian counts as: the radius that the wheels turn on
_CALIBRATION_WINDOW = 20  # Scans between poses that calibrate the wheels: fewer differ by the sway
_MAX_SCALE_ERROR = 0.2  # A scale farther from 1 is not used: something else is wrong then


def localize(log: ScanLog, progress: Progress = silent) -> ScanLog:
    """Return the log with poses from scan matching, and with its errors reported where the truth is known.

    Four degrees of freedom are found: x, y and yaw of the robot's foot, and its pitch, approximately (see
    `estimate_pitch`). Leveling finds a fifth, see `level_floor`; the foot stands on the ground.

    Args:
        log: with horizontal scans.
        progress: called with the current step.

    Raises:
        ScanError: the log has no horizontal scans.
        MissingExtraError: the extra `scan` is not installed.
    """
    scans = log.horizontal
    if scans is None:
        raise ScanError("the log has no horizontal scans to localize by; give poses with the ScanLog")
    place = scans.mount[:3, 3]
    height = float(place[2])
    declination = estimate_declination(log)
    shake = max(estimate_shake(declination), _LEAST_SHAKE)
    lean = (compute_tilt(log, declination)[:, :3, :3] @ place - place)[:, :2]
    matched = match_to_map(scans, lean, progress)
    sway = float(np.hypot(shake * height, _MATCH_ERROR))
    planar = fuse_odometry(matched, scans.odometry, sway)
    pitch = estimate_pitch(matched, planar, height, sway)
    turn = scans.start[2] - planar[0, 2]
    moved = transform_planar(planar[:, :2] - planar[0, :2], np.array([*scans.start[:2], turn]))
    planar = np.c_[moved, planar[:, 2] + scans.start[2] - planar[0, 2]]
    robot = make_pose(*planar.T, pitch=pitch)
    robot[:, 2, 3] = (log.poses @ np.linalg.inv(log.mount))[:, 2, 3]
    report = dict(log.report)
    if log.truth is not None:
        report |= measure_localization(planar, to_planar(log.truth.robot_poses))
    return log.replace(poses=robot @ log.mount, report=report)


def measure_localization(
    planar: Float[np.ndarray, "S 3"], true: Float[np.ndarray, "S 3"]
) -> dict[str, float]:
    """Return the largest and the median error [m] and [deg] of poses (x, y, yaw)."""
    distance = np.hypot(*(planar - true)[:, :2].T)
    angle = np.degrees(np.abs((planar[:, 2] - true[:, 2] + np.pi) % (2 * np.pi) - np.pi))
    return {
        "localization_max": float(distance.max()),
        "localization_median": float(np.median(distance)),
        "localization_max_deg": float(angle.max()),
        "localization_median_deg": float(np.median(angle)),
    }


def estimate_pitch(
    matched: Float[np.ndarray, "S 3"], planar: Float[np.ndarray, "S 3"], height: float, sway: float
) -> Float[np.ndarray, " S"]:
    """Find the robot's pitch at every scan from the sway of its horizontal scanner [rad].

    A scanner at height h is carried ahead of the foot by ``h sin(p)``. With d the way from the smooth track to
    the matched pose, ahead: ``p = d / h * s^2 / (s^2 + m^2)``, s the sway to be expected, m the error of matching.

    The wheels leave the track uncertain, and sway that lasts looks like driving. For a scanner at 0.3 m, vibration of
    0.7 degrees with a memory of half a scan, wheels wrong by 5 mm a square root of a meter and matches good to
    0.8 mm, the optimal (Wiener) filter leaves 0.29 degrees; this leaves 0.30.
    """
    if height < _MIN_HEIGHT:
        return np.zeros(len(planar))
    ahead = np.stack([np.cos(planar[:, 2]), np.sin(planar[:, 2])], axis=1)
    lead = ((matched - planar)[:, :2] * ahead).sum(axis=1)
    share = sway**2 / (sway**2 + _MATCH_ERROR**2)
    return np.arcsin(np.clip(share * lead / height, -_MAX_PITCH, _MAX_PITCH))


class _Map(NamedTuple):
    """Points of the walls in three layers, with normals, and the search tree over them."""

    cloud: PointCloud
    tree: KdTree


def match_to_map(
    scans: HorizontalScans, lean: Float[np.ndarray, "S 2"], progress: Progress = silent
) -> Float[np.ndarray, "S 3"]:
    """Match horizontal scans to a map that is made of them, and return x, y, yaw; the scanner leans off the foot.

    1. A scan starts where the odometry leads from the one before, is matched to the map of the key scans so far,
       and becomes one where the robot has gone on by 0.4 m or 0.35 rad.
    2. Some 400 scans are matched to the map of them all, 8 times over: the map settles, its loop closes.
    3. Every scan is matched to the final map.
    """
    require_extras("localizing a robot", "scan")
    num_scans = len(scans.ranges)
    if not num_scans:
        return np.empty((0, 3))
    points = _select_wall_points(scans)
    planar = _follow(scans, points, progress)
    keys = list(range(0, num_scans, max(1, num_scans // _MAX_KEYS)))
    for k in range(_NUM_ROUNDS):
        target = _make_map(points, planar, keys)
        planar[keys] = [_align(target, points[i], planar[i], _REACH) for i in keys]
        progress("localizing: settling the map", _FIRST_PASS + _SETTLING * k / _NUM_ROUNDS)
    target = _make_map(points, planar, keys)
    planar = np.stack([_align(target, p, guess, _REACH) for p, guess in zip(points, planar, strict=True)])
    planar[:, :2] -= rotate_planar(lean, planar[:, 2])
    return planar


def _follow(scans: HorizontalScans, points: list[np.ndarray], progress: Progress) -> Float[np.ndarray, "S 3"]:
    """Match every scan to the map of the key scans before it."""
    num_scans = len(points)
    planar, keys = np.tile(scans.start, (num_scans, 1)), [0]
    target = _make_map(points, planar, keys)
    for i in range(1, num_scans):
        step = compute_planar_step(scans.odometry[i - 1], scans.odometry[i])
        guess = compose_planar(planar[i - 1], step)
        planar[i] = _align(target, points[i], guess, _FIRST_REACH)
        gone = planar[i] - planar[keys[-1]]
        if np.hypot(*gone[:2]) > _KEY_DISTANCE or abs(gone[2]) > _KEY_ANGLE:
            keys.append(i)
            target = _make_map(points, planar, keys)
        if i % _PROGRESS_INTERVAL == 0:
            progress("localizing: first pass", _FIRST_PASS * i / num_scans)
    return planar


def _select_wall_points(scans: HorizontalScans) -> list[np.ndarray]:
    """Return end points `[N, 2]` in the robot's plane, scan by scan, without those at edges."""
    jumps = np.pad(find_jumps(scans.ranges), ((0, 0), (1, 1)), constant_values=True)
    good = np.isfinite(scans.ranges) & ~jumps[:, 1:] & ~jumps[:, :-1]
    beams = np.stack([np.cos(scans.angles), np.sin(scans.angles)], axis=1)
    found = []
    for ranges, is_good in zip(scans.ranges, good, strict=True):
        ends = ranges[is_good, None] * beams[is_good]
        found.append(ends @ scans.mount[:2, :2].T + scans.mount[:2, 3])
    return found


def _make_map(points: list[np.ndarray], planar: Float[np.ndarray, "S 3"], keys: Sequence[int]) -> _Map | None:
    """Average the readings of the key scans in cells, project them onto lines, find normals; None: nothing seen."""
    import small_gicp

    cloud = np.concatenate([transform_planar(points[k], planar[k]) for k in keys])
    if len(cloud) < _MIN_MAP_POINTS:
        return None
    grid = np.floor(cloud / _MAP_CELL).astype(np.int64)
    grid -= grid.min(axis=0)
    _, index, counts = np.unique(
        grid[:, 0] * (grid[:, 1].max() + 1) + grid[:, 1], return_inverse=True, return_counts=True
    )
    means = np.stack([np.bincount(index, cloud[:, k]) / counts for k in range(2)], axis=1)
    walls = _project_onto_lines(means, counts.astype(float))
    layers = (-_LAYER_HEIGHT, 0.0, _LAYER_HEIGHT)
    raised = small_gicp.PointCloud(np.concatenate([np.c_[walls, np.full(len(walls), z)] for z in layers]))
    tree = small_gicp.KdTree(raised)
    small_gicp.estimate_normals_covariances(raised, tree, num_neighbors=_NORMAL_POINTS)
    return _Map(raised, tree)


def _project_onto_lines(
    points: Float[np.ndarray, "N 2"], weights: Float[np.ndarray, " N"]
) -> Float[np.ndarray, "M 2"]:
    """Project points onto the line through their neighbors, and drop those at corners.

    A map as thick as the noise holds scans where they are: a point finds its own error in it.
    """
    distance, near = KDTree(points).query(points, min(_LINE_POINTS, len(points)))
    weight = weights[near] * (distance < _LINE_REACH)
    total = weight.sum(axis=1)
    center = np.einsum("nk,nki->ni", weight, points[near]) / total[:, None]
    offset = points[near] - center[:, None]
    covariance = np.einsum("nk,nki,nkj->nij", weight, offset, offset) / total[:, None, None]
    values, vectors = np.linalg.eigh(covariance)
    normal = vectors[:, :, 0]
    projected = points - ((points - center) * normal).sum(axis=1, keepdims=True) * normal
    is_line = (values[:, 0] < _MAX_FLATNESS * values[:, 1]) & (total >= _MIN_LINE_READINGS)
    return projected[is_line] if is_line.sum() >= _MIN_MAP_POINTS else projected


def _align(
    target: _Map | None, points: Float[np.ndarray, "N 2"], guess: Float[np.ndarray, " 3"], reach: float
) -> Float[np.ndarray, " 3"]:
    """Match points to the map from a guess, which is kept where the walls in view leave a direction open.

    With d the step from guess to match and H the match's information (per variance of a reading), the pose is
    ``guess + (H / s^2 + P)^-1 (H / s^2) d``, P the guess's information.
    """
    import small_gicp

    if target is None or not len(points):
        return guess
    result = small_gicp.align(
        target.cloud,
        small_gicp.PointCloud(np.c_[points, np.zeros(len(points))]),
        target.tree,
        make_pose(*guess),
        registration_type="PLANE_ICP",
        max_correspondence_distance=reach,
        rotation_epsilon=_ROTATION_TOLERANCE,
        translation_epsilon=_TRANSLATION_TOLERANCE,
        max_iterations=_MAX_ITERATIONS,
    )
    step = compute_planar_step(guess, to_planar(result.T_target_source[None])[0])
    step[2] = (step[2] + np.pi) % (2 * np.pi) - np.pi
    information = result.H[np.ix_(_PLANAR, _PLANAR)] / _READING_NOISE**2
    step = np.linalg.solve(information + _GUESS_INFORMATION, information @ step)
    return compose_planar(guess, step)


def fuse_odometry(
    planar: Float[np.ndarray, "S 3"], odometry: Float[np.ndarray, "S 3"], sway: float
) -> Float[np.ndarray, "S 3"]:
    """Smooth matched poses by the steps of the odometry.

    The wheels are calibrated first, by the mean ratio of matched and counted ways and turns. Then this minimizes
    ``sum |x_i - z_i|^2 / sway^2 + sum |x_(i+1) - x_i - R(yaw_i) u_i|^2 / (slip^2 way_i)`` over all positions x, z
    the matched ones and u the steps of the wheels: a tridiagonal system, solved exactly. Likewise for yaw.
    """
    if len(planar) < 3:
        return planar
    step, turn = np.diff(odometry[:, :2], axis=0), np.diff(odometry[:, 2])
    turn *= _estimate_scale(planar[:, 2:], turn[:, None])
    way = np.hypot(*step.T) + _TURN_WAY * np.abs(turn)
    slip = estimate_slip(planar[:, 2] - planar[0, 2] - _add_up(turn), _add_up(way))
    variance = slip**2 * way + _MIN_VARIANCE
    yaw = _smooth_track(planar[:, 2:], turn[:, None], _YAW_NOISE**2 / variance)[:, 0]
    step = rotate_planar(step, yaw[:-1] - odometry[:-1, 2])
    step *= _estimate_scale(planar[:, :2], step)
    middle = yaw[:-1] + turn / 2
    ahead = ((np.diff(planar[:, :2], axis=0) - step) * np.c_[np.cos(middle), np.sin(middle)]).sum(axis=1)
    slip = estimate_slip(_add_up(ahead), _add_up(way))
    variance = slip**2 * way + _MIN_VARIANCE
    return np.c_[_smooth_track(planar[:, :2], step, sway**2 / variance), yaw]


def _add_up(steps: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N+1"]:
    return np.concatenate([[0.0], np.cumsum(steps)])


def estimate_slip(error: Float[np.ndarray, " S"], way: Float[np.ndarray, " S"]) -> float:
    """Return the slip of wheels [m] after one meter, from the error of their track.

    The mean squared difference of the error over k scans (a variogram) is ``2 sway^2 + slip^2 way_k``: a line through
    it has the slip as its slope, and sway and matching, which do not add up, as its offset.
    """
    if len(error) < LEAST_SCANS:
        return _UNKNOWN_SLIP
    square = [float(np.mean((error[k:] - error[:-k]) ** 2)) for k in _LAGS]
    mean_way = [float(np.mean(way[k:] - way[:-k])) for k in _LAGS]
    if np.ptp(mean_way) == 0.0:
        return _UNKNOWN_SLIP
    return float(np.sqrt(max(np.polyfit(mean_way, square, 1)[0], 0.0)))


def _estimate_scale(measured: Float[np.ndarray, "S D"], steps: Float[np.ndarray, "S-1 D"]) -> float:
    """Return the true way where the wheels count 1, by least squares over stretches of the track."""
    window = _CALIBRATION_WINDOW
    counted = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
    if len(measured) <= 2 * window:
        return 1.0
    real, counted = measured[window:] - measured[:-window], counted[window:] - counted[:-window]
    total = float((counted * counted).sum())
    scale = float((real * counted).sum()) / total if total > _MIN_SQUARED_WAY else 1.0
    return scale if abs(scale - 1) < _MAX_SCALE_ERROR else 1.0


def _smooth_track(
    measured: Float[np.ndarray, "S D"], steps: Float[np.ndarray, "S-1 D"], weight: Float[np.ndarray, " S-1"]
) -> Float[np.ndarray, "S D"]:
    """Solve the normal equations of the sum that `fuse_odometry` minimizes, `weight` those of the steps."""
    bands = np.zeros((2, len(measured)))
    bands[0, 1:] = -weight
    bands[1] = 1.0
    bands[1, 1:] += weight
    bands[1, :-1] += weight
    pull = np.zeros_like(measured)
    pull[1:] += weight[:, None] * steps
    pull[:-1] -= weight[:, None] * steps
    return solveh_banded(bands, measured + pull)
