"""Check that a cloud of points holds a surface."""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError

FLATNESS = 1e-6
"""A cloud thinner than this share of its length in two directions is a line: far below the noise of any scanner, and
above the rounding errors of single precision."""
_MIN_POINTS = 4
"""A tetrahedron: fewer points span no closed surface."""
_MAX_COORDINATE = 1e100
"""No length; and products of three larger coordinates overflow."""
_SAME_PLACE = 1e-12
"""Extent of a cloud over its coordinates, below which rounding errors are all there is of it."""


def check_points(points: ArrayLike) -> Float[np.ndarray, "N 3"]:
    """Return the points as a contiguous float64 array.

    Any real number type in any memory order is accepted.
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
    if len(array) < _MIN_POINTS:
        raise ReconstructionError(f"a surface needs at least {_MIN_POINTS} points, got {len(array)}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        is_finite = np.isfinite(array).all(axis=1)
        raise ReconstructionError(
            f"{int((~is_finite).sum())} of {len(array)} points hold NaN or infinity (the first at row "
            f"{int(np.argmin(is_finite))}); drop them: points[np.isfinite(points).all(axis=1)]"
        )
    _check_extent(array)
    return array


def check_number(points: Float[np.ndarray, "N 3"], units: int) -> None:
    """Check the number of units of a network."""
    if isinstance(units, bool) or not isinstance(units, int | np.integer):
        raise ReconstructionError(f"units must be a whole number, got {units!r}")
    if units < _MIN_POINTS:
        raise ReconstructionError(f"units must be at least {_MIN_POINTS}, got {units}")
    distinct = len(points)
    if units <= distinct and len(np.unique(points[:, 0])) < units:
        distinct = len(np.unique(points, axis=0))
    if units > distinct:
        raise ReconstructionError(
            f"{units} units are more than the {distinct} distinct points; ask for at most {distinct}, "
            "better for a tenth"
        )


def _check_extent(points: Float[np.ndarray, "N 3"]) -> None:
    """Refuse clouds that lie in one place or on one line, and coordinates that would overflow."""
    axes = np.ascontiguousarray(points.T)  # rows as long as the cloud: several times as fast
    extent = np.ptp(axes, axis=1).max()
    magnitude = np.abs(axes).max()
    if not np.isfinite(extent) or magnitude > _MAX_COORDINATE:
        raise ReconstructionError(f"coordinates up to {magnitude:.3g} are too large; what is their unit?")
    if extent <= _SAME_PLACE * magnitude or extent == 0:
        raise ReconstructionError(f"all {len(points)} points lie in one place, {points[0].tolist()}")
    centered = (axes - axes.mean(axis=1, keepdims=True)) / extent
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(centered @ centered.T), 0))
    if values[1] <= FLATNESS * values[2]:
        raise ReconstructionError(f"all {len(points)} points lie on one line, they hold no surface")


def check_seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ReconstructionError(f"seed must be a whole number from 0 on, got {seed!r}")
    return int(seed)
