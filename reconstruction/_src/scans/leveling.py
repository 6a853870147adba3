"""Leveling: the robot tilts as it drives, the floor stays level (paper, section II-A)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.pose import rotate_about
from reconstruction._src.scans.scan import ScanLog

_NEIGHBOR_VOTE = 0.5  # Weight of the bins on both sides in a vote: a floor between two bins is found as well
_REFINEMENTS = 2.0, 1.0, 1.0, 1.0  # Widths of Tukey's weights in tolerances: the vote is uncertain by a bin
_MIN_WEIGHT = 1e-3  # Least sum of squared distances [m^2] to refine a declination by: a reading at 3 cm
_TINY = 1e-12
_SHAKES = 5.5  # Tilts up to this many standard deviations of the sway are looked for
_TILTS = (float(np.radians(2.0)), float(np.radians(8.0)))
"""Smallest and largest limit of the tilt [rad]: a standing robot may lean on its floor; ramps are steeper."""
_UNKNOWN_TILT = float(np.radians(4.0))  # Limit of the tilt in logs of few scans [rad]
_SAMPLE = 400  # About as many scans tell how much a robot sways

_NUM_BINS = 40  # Bins of declination between -max_tilt and max_tilt that readings vote for: 0.2 degrees each
_MIN_DISTANCE = 0.2  # Readings nearer to the robot's foot do not vote [m]: their direction is uncertain
_FULL_WEIGHT_DISTANCE = 1.0  # A vote's weight grows with the distance from the foot up to this one [m]
_HEIGHT_BIN = 0.02  # Bins of height [m] that the floor is found in, where a log has no `mount`
_HEIGHT_SHARE = 0.5  # The floor is the lowest bin with at least this share of the readings of the fullest

_MAX_SLOPE = 0.3  # A scan plane is vertical where its normal rises by less than this
_TOLERANCE = 0.03  # Largest distance of a reading from the floor [m]: three sigmas of a common scanner
LEAST_SCANS = 100
"""Logs of fewer scans tell nothing about noise."""
UNKNOWN_SHAKE = float(np.radians(1.0))  # Sway where nothing is known [rad]
_GAUSSIAN = 1.4826  # Standard deviation of a normal distribution in median absolute deviations


def level_floor(log: ScanLog) -> ScanLog:
    """Turn every vertical scan so that its floor is level: ``T <- T_robot R(n, -delta) T_mount``.

    delta is the declination of the floor's line in the scan (`estimate_declination`), n the normal of the scan plane.
    The rotation is about the robot's foot, where it touches the ground, so a sensor on a mast moves sideways as
    it did; a log without `mount` is rotated about the sensor.

    This finds the tilt within the scan plane, and on a level floor nothing else: tilted across the plane by p, the
    scan meets the same floor in the same line, at the same ranges. What is h above the floor, it shows h sin(p)
    off its position across the plane. Where a horizontal scanner localizes the robot, its sway gives p
    approximately (`reconstruction._src.scans.localization.estimate_pitch`); the rest stays.

    Args:
        log: scans; those that are not vertical, or show no floor, are left as they are.
    """
    turn = compute_tilt(log, estimate_declination(log))
    return log.replace(poses=log.poses @ np.linalg.inv(log.mount) @ turn @ log.mount)


def compute_tilt(log: ScanLog, declination: Float[np.ndarray, " S"]) -> Float[np.ndarray, "S 4 4"]:
    """Return the robot's tilt in the plane of every scan: ``R(n, -delta)`` of `level_floor`."""
    turn = np.tile(np.eye(4), (len(declination), 1, 1))
    if declination.any():
        turn[:, :3, :3] = rotate_about(np.cross(*_plane_axes(log.mount)), -declination)
    return turn


def estimate_declination(log: ScanLog) -> Float[np.ndarray, " S"]:
    """Find the declination of the floor's line in every scan [rad]; 0 where no floor is seen.

    With (u, v) the position of a reading to the side of the robot's foot and above it, the floor is the line
    ``v = u tan(delta)``. Readings vote for v/u with weight min(|u|, 1 m); from the best bin, tan(delta) is
    refined as ``sum(w u v) / sum(w u^2)`` with Tukey's weights ``w = (1 - (residual / tolerance)^2)^2``.

    A log without `mount` has its foot found first: under the sensor, at the height of most readings.
    """
    if len(log.ranges) == 0 or not _is_vertical(log):
        return np.zeros(len(log.ranges))
    u, v = _plane_coordinates(log)
    max_tilt = _UNKNOWN_TILT
    if len(u) >= LEAST_SCANS:
        some = slice(None, None, max(1, len(u) // _SAMPLE))
        shake = estimate_shake(_find_angles(u[some], v[some], _TILTS[1]))
        max_tilt = float(np.clip(_SHAKES * shake, *_TILTS))
    return _find_angles(u, v, max_tilt)


def estimate_shake(declination: Float[np.ndarray, " S"]) -> float:
    """Return the standard deviation of the sway [rad], from the declination of the floor in every scan.

    The floor shows the roll of a robot; its pitch is taken as alike. Scans in which no floor was seen have 0.
    """
    seen = declination[declination != 0.0]
    if len(seen) < LEAST_SCANS:
        return UNKNOWN_SHAKE
    return float(_GAUSSIAN * np.median(np.abs(seen - np.median(seen))))


def _find_angles(
    u: Float[np.ndarray, "S B"], v: Float[np.ndarray, "S B"], max_tilt: float
) -> Float[np.ndarray, " S"]:
    """Return the declination in every scan, looked for up to a largest one [rad]."""
    limit = float(np.tan(max_tilt))
    tangent = _refine(u, v, _vote(u, v, limit), limit)
    return np.arctan(np.clip(tangent, -limit, limit))


def _vote(u: Float[np.ndarray, "S B"], v: Float[np.ndarray, "S B"], limit: float) -> Float[np.ndarray, " S"]:
    """Return the tangent of the declination with most votes in every scan; 0 where there are none."""
    num_scans, num_bins = len(u), _NUM_BINS
    with np.errstate(divide="ignore", invalid="ignore"):
        place = (v / u / limit + 1) * (num_bins / 2)
    is_vote = np.abs(u) > _MIN_DISTANCE
    is_vote &= (place > 0) & (place < num_bins)
    scan, _ = np.nonzero(is_vote)
    bins = place[is_vote].astype(np.int64) + num_bins * scan
    weight = np.minimum(np.abs(u[is_vote]), _FULL_WEIGHT_DISTANCE)
    table = np.bincount(bins, weight, minlength=num_bins * num_scans).reshape(num_scans, num_bins)
    votes = table.astype(float)
    votes[:, 1:] += _NEIGHBOR_VOTE * table[:, :-1]
    votes[:, :-1] += _NEIGHBOR_VOTE * table[:, 1:]
    tangent = ((votes.argmax(axis=1) + 0.5) / num_bins * 2 - 1) * limit
    tangent[votes.max(axis=1) == 0] = 0.0
    return tangent


def _refine(
    u: Float[np.ndarray, "S B"], v: Float[np.ndarray, "S B"], tangent: Float[np.ndarray, " S"], limit: float
) -> Float[np.ndarray, " S"]:
    """Return the tangent of the declination by least squares with Tukey's weights."""
    is_near = np.abs(v) < 2 * limit * np.abs(u) + _TOLERANCE
    scan, _ = np.nonzero(is_near)
    u_near, v_near = u[is_near], v[is_near]
    for width in _REFINEMENTS:
        residual = (v_near - tangent[scan] * u_near) / (width * _TOLERANCE)
        w = np.maximum(1.0 - residual * residual, 0.0)
        w *= w * u_near
        total = np.bincount(scan, w * u_near, minlength=len(tangent))
        moment = np.bincount(scan, w * v_near, minlength=len(tangent))
        tangent = np.where(total > _MIN_WEIGHT, moment / np.maximum(total, _TINY), tangent)
    return tangent


def _plane_coordinates(log: ScanLog) -> tuple[Float[np.ndarray, "S B"], Float[np.ndarray, "S B"]]:
    """Return the positions to the side of the foot and above it, in the plane of the scan."""
    axes = np.stack(_plane_axes(log.mount))
    rows = axes @ log.mount[:3, :2] @ np.stack([np.cos(log.angles), np.sin(log.angles)])
    offset = axes @ log.mount[:3, 3]
    u, v = log.ranges * rows[0] + offset[0], log.ranges * rows[1] + offset[1]
    if not np.any(log.mount[:3, 3]):
        v = v - _estimate_floor_height(v)
    return u, v


def _estimate_floor_height(heights: Float[np.ndarray, "S B"]) -> float:
    """Return the height of most readings below the sensor, or the lowest one with nearly as many."""
    low = heights[heights < 0]
    if not low.size:
        return 0.0
    counts = np.bincount(((low - low.min()) / _HEIGHT_BIN).astype(np.int64))
    peak = low.min() + (np.argmax(counts >= _HEIGHT_SHARE * counts.max()) + 0.5) * _HEIGHT_BIN
    return float(low[np.abs(low - peak) < 2 * _HEIGHT_BIN].mean())


def _is_vertical(log: ScanLog) -> bool:
    """Return whether the scan plane is vertical, in the robot and in the world."""
    world = np.abs(log.poses[:, 2, 2])
    return bool(np.abs(log.mount[2, 2]) < _MAX_SLOPE and np.median(world) < _MAX_SLOPE)


def _plane_axes(mount: Float[np.ndarray, "4 4"]) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return the horizontal and the rising direction of the scan plane, in the robot."""
    normal = mount[:3, 2]
    side = np.cross([0.0, 0.0, 1.0], normal)
    side /= np.linalg.norm(side)
    return side, np.cross(normal, side)
