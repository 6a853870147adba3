"""Refuse clouds that hold no surface, saying why."""

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.errors import ReconstructionError

FLATNESS = 1e-6
"""A cloud thinner than this share of its length in two directions is a line."""


def check_points(points: ArrayLike) -> np.ndarray:
    """Return the points as a contiguous `[N, 3]` float64 array.

    Any real number type will do (float16, too: its values are taken as they are), in any memory order.

    Raises:
        ReconstructionError: another shape, not numbers, NaN or infinity, fewer than 4 points, all in one
            place or on one line.
    """
    try:
        array = np.asarray(points)
        if array.dtype.kind not in "fiu":
            raise TypeError(f"values are {array.dtype}")
    except (TypeError, ValueError) as error:
        raise ReconstructionError(f"points must be real numbers of the shape [N, 3]: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise ReconstructionError(
            f"points must have the shape [N, 3], got {list(array.shape)}; one row x, y, z per point"
        )
    if len(array) < 4:
        raise ReconstructionError(f"a surface needs at least 4 points, got {len(array)}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        is_finite = np.isfinite(array).all(axis=1)
        raise ReconstructionError(
            f"{int((~is_finite).sum())} of {len(array)} points hold NaN or infinity (the first at row "
            f"{int(np.argmin(is_finite))}); drop them: points[np.isfinite(points).all(axis=1)]"
        )
    _check_extent(array)
    return array


def check_number(points: np.ndarray, units: int) -> None:
    """Refuse a number of units that is no number, too small, or larger than that of the distinct points.

    Raises:
        ReconstructionError: with the value and the range.
    """
    if isinstance(units, bool) or not isinstance(units, int | np.integer):
        raise ReconstructionError(f"units must be a whole number, got {units!r}")
    if units < 4:
        raise ReconstructionError(f"units must be at least 4, got {units}")
    distinct = len(points)
    if units <= distinct and len(np.unique(points[:, 0])) < units:
        distinct = len(np.unique(points, axis=0))
    if units > distinct:
        raise ReconstructionError(
            f"{units} units are more than the {distinct} distinct points; ask for at most {distinct}, "
            "better for a tenth"
        )


def _check_extent(points: np.ndarray) -> None:
    axes = np.ascontiguousarray(points.T)  # rows as long as the cloud: several times as fast
    extent = np.ptp(axes, axis=1).max()
    magnitude = np.abs(axes).max()
    if not np.isfinite(extent) or magnitude > 1e100:
        raise ReconstructionError(f"coordinates up to {magnitude:.3g} are too large; what is their unit?")
    if extent <= 1e-12 * magnitude or extent == 0:
        raise ReconstructionError(f"all {len(points)} points lie in one place, {points[0].tolist()}")
    centered = (axes - axes.mean(axis=1, keepdims=True)) / extent
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(centered @ centered.T), 0))
    if values[1] <= FLATNESS * values[2]:
        raise ReconstructionError(f"all {len(points)} points lie on one line, they hold no surface")
