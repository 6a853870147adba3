"""Points in cells of space: cropping, thinning, and the histogram that finds stray ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.errors import ScanError
from reconstruction.scans.scan import Array

_NEIGHBORS = 12
"""Points a cell of the histogram should hold, in the middle."""
_SAMPLE = 40_000
_SEARCH_STEPS = 24
_PRIMES = np.array([73856093, 19349663, 83492791])


def as_points(points: ArrayLike) -> Array:
    """Check that these are points `[N, 3]`, and drop rows that are not finite.

    Raises:
        ScanError: another shape, or no numbers.
    """
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"points must be numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise ScanError(f"points must have shape [N, 3], not {array.shape}")
    finite = np.isfinite(array).all(axis=1)
    return array if finite.all() else array[finite]


def crop(points: ArrayLike, box: ArrayLike, margin: float = 0.05) -> Array:
    """Keep the points in a box.

    Args:
        points: `[N, 3]` [m].
        box: `[[x, y, z lowest], [x, y, z highest]]` [m].
        margin: spared below and above; the sides are cut sharply [m].

    Raises:
        ScanError: the box is none.
    """
    points, box = as_points(points), np.asarray(box, dtype=np.float64)
    if box.shape != (2, 3) or not (box[0] <= box[1]).all():
        raise ScanError(f"box must be [[lowest], [highest]] corner, shape (2, 3), not {box.tolist()}")
    spare = np.array([0.0, 0.0, margin])
    return points[((points >= box[0] - spare) & (points <= box[1] + spare)).all(axis=1)]


def thin(points: ArrayLike, voxel: float) -> Array:
    """Replace the points of every cube by their mean; the cubes' edges are `voxel` [m] long.

    Raises:
        ScanError: `voxel` is not above 0, or so small that the cubes cannot be counted.
    """
    points = as_points(points)
    if not 0 < voxel < np.inf:
        raise ScanError(f"voxel must be above 0, got {voxel}")
    if not len(points):
        return points
    keys = _cell_keys(points, voxel)
    _, index, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(index.ravel(), points[:, k]) / counts for k in range(3)], axis=1)


def find_sparse_points(
    points: ArrayLike, cell: float | None = None, threshold: int | None = None, max_share: float = 0.03
) -> NDArray[np.bool_]:
    """Find the points whose cell of a 3-D histogram holds fewer than `threshold` points, `[N]`.

    A point's count is the higher one of two histograms, shifted against each other by half a cell.

    Args:
        points: `[N, 3]` [m].
        cell: edge of the cells [m]. Default: the middle point has 12 in its cell, or more, so that at most
            `max_share` of the points lie below the threshold.
        threshold: default: 3.
        max_share: see `cell`; 0 finds nothing.
    """
    points = as_points(points)
    threshold = 3 if threshold is None else threshold
    if len(points) < 4 * _NEIGHBORS or not np.ptp(points, axis=0).any():
        return np.zeros(len(points), bool)
    if cell is not None:
        return _count_in_cells(points, cell) < threshold
    cell = _find_cell(points)
    for _ in range(_SEARCH_STEPS):
        is_sparse = _count_in_cells(points, cell) < threshold
        if is_sparse.mean() <= max_share:
            return is_sparse
        cell *= 1.5
    return np.zeros(len(points), bool)


def _find_cell(points: Array) -> float:
    """Edge at which a point shares its cell with 11 others on average, found on every n-th point."""
    high = float(np.ptp(points, axis=0).max())
    low = high / 2.0**14
    blocks = max(1, len(points) // _SAMPLE)
    sample = points[::blocks]
    for _ in range(8):
        cell = float(np.sqrt(low * high))
        others = (_count_in_cells(sample, cell, shifts=(0.0,)).mean() - 1) * blocks
        low, high = (cell, high) if others < _NEIGHBORS - 1 else (low, cell)
    return high


def _count_in_cells(points: Array, cell: float, shifts: tuple[float, ...] = (0.0, 0.5)) -> NDArray[np.int64]:
    """Count the points in the cell of every point, the most of all shifts.

    Cells share a table of 16 counters a point, 4 million at most (Teschner et al. 2003, spatial hashing): now and
    then two cells are counted as one, and a stray point is spared.
    """
    counts = np.zeros(len(points), np.int64)
    table = 1 << int(np.clip((16 * len(points)).bit_length(), 12, 22))
    scaled = (points - points.min(axis=0)) / cell
    for shift in shifts:
        place = (scaled + shift).astype(np.int64)
        place *= _PRIMES
        hashed = (place[:, 0] ^ place[:, 1] ^ place[:, 2]) & (table - 1)
        np.maximum(counts, np.bincount(hashed, minlength=table)[hashed], out=counts)
    return counts


def _cell_keys(points: Array, cell: float) -> NDArray[np.int64]:
    """One number a cell."""
    place = np.floor((points - points.min(axis=0)) / cell)
    size = place.max(axis=0) + 1
    if size.prod() > 2.0**62:
        raise ScanError(
            f"cells of {cell:g} m are too small for an extent of {np.ptp(points, axis=0).max():g} m"
        )
    x, y, z = place.astype(np.int64).T
    return (x * int(size[1]) + y) * int(size[2]) + z
