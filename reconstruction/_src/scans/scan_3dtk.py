"""Raw ordered scans in the form of 3DTK: points in `scan000.3d`, the sensor's pose in `scan000.pose`.

3DTK's frame is left-handed, in centimeters: x to the right, y up, z ahead. Here x is ahead, y to the left, z up,
in meters.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.bounded_read import MAX_BYTES, UnreadableFileError, open_bounded
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.text_points import read_text

_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rows: ahead, left and up in 3DTK's coordinates."""
_UNITS_PER_METER = 100.0
_MAX_POSE_BYTES = 10_000  # Largest .pose: it holds six numbers
_NEW_SWEEP = -np.pi / 4
"""Change of the angle within the sweep [rad] that begins a new one: beams of one sweep turn the other way."""


def to_right_handed(points: ArrayLike) -> Float[np.ndarray, "N 3"]:
    """Return 3DTK points `[N, 3]` [cm] as x ahead, y left, z up [m]."""
    return np.asarray(points, float) @ _AXES.T / _UNITS_PER_METER


def load_3dtk(
    path: Path, min_range: float = 0.2, max_range: float = 32.0, max_bytes: float = MAX_BYTES
) -> ScanLog:
    """Read the raw scan of a tilting planar scanner as a log: one scan a sweep."""
    try:
        with open_bounded(path, max_bytes) as file:
            points = read_text(file).points
    except (ScanError, UnreadableFileError) as error:
        raise ScanError(f"{path}: {error}") from error
    pose = read_pose(path.with_suffix(".pose"))
    num_beams = _count_beams(path, points)
    sweeps = to_right_handed(points).reshape(-1, num_beams, 3)
    ranges = np.linalg.norm(sweeps, axis=2)
    ahead = np.hypot(sweeps[..., 0], sweeps[..., 2])
    angles = np.median(np.arctan2(ahead, -sweeps[..., 1]), axis=0)
    middle = slice(num_beams // 4, 3 * num_beams // 4)
    tilt = np.median(np.arctan2(sweeps[:, middle, 2], sweeps[:, middle, 0]), axis=1)
    ranges[(ranges < min_range) | (ranges > max_range)] = np.nan
    return ScanLog(ranges, angles, pose @ _tilted(tilt))


def _tilted(tilt: Float[np.ndarray, " S"]) -> Float[np.ndarray, "S 4 4"]:
    """Return the poses of the scan planes: angle 0 to the right, 90 degrees ahead and up by the tilt."""
    zero, one = np.zeros_like(tilt), np.ones_like(tilt)
    right, ahead = np.stack([zero, -one, zero], 1), np.stack([np.cos(tilt), zero, np.sin(tilt)], 1)
    poses = np.tile(np.eye(4), (len(tilt), 1, 1))
    poses[:, :3, :3] = np.stack([right, ahead, np.cross(right, ahead)], axis=2)
    return poses


def _count_beams(path: Path, points: Float[np.ndarray, "N 3"]) -> int:
    """Find the beams of a sweep: the angle within the sweep falls back where the next one begins."""
    angle = np.arctan2(np.hypot(points[:, 1], points[:, 2]), points[:, 0])
    starts = np.flatnonzero(np.diff(angle) < _NEW_SWEEP) + 1
    num_beams = int(starts[0]) if len(starts) else 0
    if (
        num_beams < 2
        or len(points) % num_beams
        or not np.array_equal(starts, np.arange(num_beams, len(points), num_beams))
    ):
        raise ScanError(f"{path}: {len(points)} points that are not ordered in sweeps of equal length")
    return num_beams


def read_pose(path: Path) -> Float[np.ndarray, "4 4"]:
    """Read position [cm] and Euler angles [deg] about x, y, z (left-handed) as a pose, sensor -> world."""
    try:
        with open_bounded(path, _MAX_POSE_BYTES) as file:
            values = np.array(file.read_exactly(file.size).split(), dtype=float)
    except ValueError as error:
        raise ScanError(f"{path}: {error}") from error
    if values.shape != (6,) or not np.isfinite(values).all():
        raise ScanError(f"{path}: needs 6 finite numbers (position, angles), has {len(values)}")
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(values[3:])), np.sin(np.radians(values[3:]))
    turn_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    turn_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    turn_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3] = _AXES @ turn_x @ turn_y @ turn_z @ _AXES.T
    pose[:3, 3] = _AXES @ values[:3] / _UNITS_PER_METER
    return pose
