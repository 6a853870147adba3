"""The points of a file in its own frame, and the way from there to ours: meters, z up, small coordinates."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Num, UInt8

from reconstruction._src.base.errors import ScanError

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200 / 3937, "in": 0.0254}
"""Meters in one unit of the file: ft is the international foot, us-ft the foot of American land surveys."""
UP_AXES = {
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}
"""Axis of the file that points up -> rows: our x, y, z in the file's coordinates. All are rotations. y: as glTF files
are; -y: a camera that looks along z, with y down."""
CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rows: ahead, left and up in the frame of a camera (x right, y down, z ahead)."""
_SIZES = 0.1, 1000.0  # Longest side of a robot's scene [m]; others mostly are in another unit
_FEW_PLACES = 0.1  # Points with fewer different coordinates, for their number, stand on a grid
_MAX_DISTANCE = 1000.0
"""A cloud whose middle (median) is farther from the origin than this, and than its own longest side, is moved
to it [m]: MuJoCo and most mesh formats keep single precision, which at 1 km is a hundred times finer than a good
scanner, and at the 5,400 km of a UTM northing moves a vertex by 0.25 m."""
_MAX_EXTENTS = 1000.0  # The same in lengths of the cloud's longest side, for small things far away
_MAX_BYTE, _MAX_SHORT = 255, 65535


class RawPoints(NamedTuple):
    """The points of a file in its own frame and unit."""

    points: Float[np.ndarray, "N 3"]  # rows may hold nan
    colors: UInt8[np.ndarray, "N 3"] | None = None  # red, green and blue from 0 to 255, or None
    viewpoints: Float[np.ndarray, "K 3"] | None = None  # positions of the sensor, or None
    seen_from: Int[np.ndarray, " N"] | None = None  # index of the viewpoint of each point, or None
    meters: float | None = None  # meters in a unit of the file, or None where the file does not say
    has_fixed_unit: bool = False  # the format has this unit, and no other
    up: str | None = None  # the axis that points up ("x", "-x", ...), or None where the file does not say
    num_ignored: int = 0  # points that the file itself marks as unusable; they are left out
    # pulses came back from several heights, and the file does not say which are the ground
    has_cover: bool = False


def to_meters(
    positions: Float[np.ndarray, "N 3"],
    raw: RawPoints,
    unit: str | None = None,
    up: str | None = None,
    scale: float = 1.0,
) -> Float[np.ndarray, "N 3"]:
    """Return positions of a file in meters with z up, by what the caller says, else the file; themselves where so."""
    if unit is not None and unit not in UNITS:
        raise ScanError(f"unknown unit {unit!r}; there are: {', '.join(UNITS)}")
    up = up or raw.up or "z"
    if up not in UP_AXES:
        raise ScanError(f"unknown axis up={up!r}; there are: {', '.join(UP_AXES)}")
    if not 0 < scale < math.inf:
        raise ScanError(f"scale must be above 0, got {scale}")
    meters = UNITS[unit] if unit is not None and not raw.has_fixed_unit else raw.meters or 1.0
    matrix = meters * scale * np.array(UP_AXES[up], float)
    # exact: one factor a column
    return positions if np.array_equal(matrix, np.eye(3)) else positions @ matrix.T


def find_offset(positions: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " 3"]:
    """Return what is subtracted from coordinates far from the origin, in whole meters; zeros from others."""
    center, extent = np.median(positions, axis=0), float(np.ptp(positions, axis=0).max())
    distance = float(np.linalg.norm(center))
    if distance <= max(_MAX_DISTANCE, extent) and distance <= _MAX_EXTENTS * extent:
        return np.zeros(3)
    return np.round(center) + 0.0


def describe_odd_size(positions: Float[np.ndarray, "N 3"]) -> str | None:
    """Return a sentence about a cloud whose size is none of a robot's scene, or None.

    Args:
        positions: `[N, 3]` [m].
    """
    smallest, largest = _SIZES
    extent = float(np.ptp(positions, axis=0).max())
    if smallest <= extent <= largest:
        return None
    size = f"{extent:,.0f} m" if extent >= 1 else f"{1000 * extent:.3g} mm"
    bound = f"above {largest:g} m" if extent > largest else f"below {100 * smallest:g} cm"
    return f"its longest side is {size}, {bound}"


def find_grid(positions: Float[np.ndarray, "N 3"]) -> float:
    """Return the step of the grid on which points stand, as those of a voxel map do [m]; 0 where on none."""
    step = np.inf
    for column in positions.T:
        places = np.unique(np.round(column, 4))
        if len(places) > _FEW_PLACES * len(positions):
            return 0.0
        step = min(step, np.diff(places).min(initial=np.inf))
    return float(step) if np.isfinite(step) else 0.0


def as_colors(values: Num[np.ndarray, "N 3"]) -> UInt8[np.ndarray, "N 3"] | None:
    """Return red, green and blue as bytes, whatever range the file uses: 0 to 1, 255 or 65535.

    None where all are zero, as files hold that reserve room for colors, and where the values are no colors.
    """
    if values.dtype == np.uint8:
        return values if values.any() else None
    finite = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=np.inf, neginf=-np.inf)
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    if low < 0 or not 0 < high <= _MAX_SHORT:
        return None
    if values.dtype.kind == "f" and high <= 1:
        finite *= _MAX_BYTE
    elif high > _MAX_BYTE:
        finite *= _MAX_BYTE / _MAX_SHORT
    return np.round(finite).astype(np.uint8)
