"""What a file holds, as it stands there: before units, axes and rows that are not finite."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Num, UInt8

_MAX_BYTE, _MAX_SHORT = 255, 65535


class RawPoints(NamedTuple):
    """The points of a file in its own frame and unit.

    Attributes:
        points: `[N, 3]`, rows may hold nan.
        colors: `[N, 3]` red, green and blue from 0 to 255, or None.
        viewpoints: `[K, 3]` positions of the sensor, or None.
        seen_from: `[N]` index of the viewpoint of each point, or None.
        meters: meters in a unit of the file, or None where the file does not say.
        has_fixed_unit: the format has this unit, and no other.
        up: the axis that points up ("x", "-x", ...), or None where the file does not say.
        num_ignored: points that the file itself marks as unusable; they are left out.
    """

    points: Float[np.ndarray, "N 3"]
    colors: UInt8[np.ndarray, "N 3"] | None = None
    viewpoints: Float[np.ndarray, "K 3"] | None = None
    seen_from: Int[np.ndarray, " N"] | None = None
    meters: float | None = None
    has_fixed_unit: bool = False
    up: str | None = None
    num_ignored: int = 0


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


def is_plausible_origin(points: Float[np.ndarray, "N 3"]) -> bool:
    """Return whether the origin can be where the sensor stood: no farther from the points than they extend.

    Formats that always state a viewpoint state the origin where nobody knew it, also for map coordinates.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return False
    low, high = finite.min(axis=0), finite.max(axis=0)
    outside = np.maximum(np.maximum(low, -high), 0)
    return bool(np.linalg.norm(outside) <= np.linalg.norm(high - low))
