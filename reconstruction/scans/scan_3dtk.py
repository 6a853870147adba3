"""Raw ordered scans in the form of 3DTK: `scan000.3d` (points) beside `scan000.pose` (where from).

3DTK counts in centimetres, left-handed, x to the right, y up, z ahead; here x is ahead, y to the left, z up,
in metres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.errors import ScanError
from reconstruction.files.bounded_read import MAX_BYTES, UnreadableFileError, open_bounded
from reconstruction.scans.scan import Array, ScanLog
from reconstruction.scans.text_points import read_text

_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rows: ahead, left and up in 3DTK's coordinates."""
_MAX_POSE = 10_000
"""Bytes that a .pose may have: it is six numbers."""


def to_right_handed(points: ArrayLike) -> Array:
    """Turn 3DTK points `[N, 3]` [cm] into x ahead, y left, z up [m]."""
    return np.asarray(points, float) @ _AXES.T / 100.0


def load_3dtk(
    path: Path, min_range: float = 0.2, max_range: float = 32.0, max_bytes: float = MAX_BYTES
) -> ScanLog:
    """Read a tilting planar scanner's raw scan as a log: one scan a sweep.

    Beams nearer than `min_range` hit the robot itself, beams beyond `max_range` did not return [m]; both
    become nan. The points may take `max_bytes`.

    Raises:
        ScanError: a file is absent or broken, or the points are not ordered in sweeps of equal length.
    """
    try:
        with open_bounded(path, max_bytes) as file:
            points = read_text(file)
    except (ScanError, UnreadableFileError) as error:
        raise ScanError(f"{path}: {error}") from error
    pose = _read_pose(path.with_suffix(".pose"))
    num_beams = _count_beams(path, points)
    sweeps = to_right_handed(points).reshape(-1, num_beams, 3)
    ranges = np.linalg.norm(sweeps, axis=2)
    ahead = np.hypot(sweeps[..., 0], sweeps[..., 2])
    angles = np.median(np.arctan2(ahead, -sweeps[..., 1]), axis=0)
    middle = slice(num_beams // 4, 3 * num_beams // 4)
    tilt = np.median(np.arctan2(sweeps[:, middle, 2], sweeps[:, middle, 0]), axis=1)
    ranges[(ranges < min_range) | (ranges > max_range)] = np.nan
    return ScanLog(ranges, angles, pose @ _tilted(tilt))


def _tilted(tilt: Array) -> Array:
    """Poses of the scan planes: angle 0 to the right, 90 degrees ahead and up by the tilt."""
    zero, one = np.zeros_like(tilt), np.ones_like(tilt)
    right, ahead = np.stack([zero, -one, zero], 1), np.stack([np.cos(tilt), zero, np.sin(tilt)], 1)
    poses = np.tile(np.eye(4), (len(tilt), 1, 1))
    poses[:, :3, :3] = np.stack([right, ahead, np.cross(right, ahead)], axis=2)
    return poses


def _count_beams(path: Path, points: Array) -> int:
    """Find the beams of a sweep: the angle within the sweep falls back where the next one begins."""
    angle = np.arctan2(np.hypot(points[:, 1], points[:, 2]), points[:, 0])
    starts = np.flatnonzero(np.diff(angle) < -np.pi / 4) + 1
    num_beams = int(starts[0]) if len(starts) else 0
    if (
        num_beams < 2
        or len(points) % num_beams
        or not np.array_equal(starts, np.arange(num_beams, len(points), num_beams))
    ):
        raise ScanError(f"{path}: {len(points)} points that are not ordered in sweeps of equal length")
    return num_beams


def _read_pose(path: Path) -> Array:
    """Read position [cm] and Euler angles [deg] about x, y, z (left-handed) as a pose of ours."""
    try:
        with open_bounded(path, _MAX_POSE) as file:
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
    pose[:3, 3] = _AXES @ values[:3] / 100.0
    return pose
