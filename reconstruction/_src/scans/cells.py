"""Points in cells of space: cropping, thinning, and the histogram that finds isolated points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.mixed_pixels import find_flat

_HASH_PRIMES = np.array([73856093, 19349663, 83492791])  # Of Teschner et al. 2003.
_COUNTERS_PER_POINT = 16
"""A cell shares its counter with another one with a probability of 1/16 at most, up to 260,000 points."""
_MIN_TABLE_BITS, _MAX_TABLE_BITS = 12, 22  # Bounds of the size of the table: 4 million counters take 32 MB
_MAX_CELLS = 2.0**62  # Numbers of cells are 64-bit integers


_POINTS_PER_CELL = 12
"""Points that share a cell in the mean, where there are enough. With 12, where the density is even, a point's
cell holds fewer than 3 by chance in 1 of 5,000 cases (Poisson)."""
_CELL_GROWTH = 1.5  # Factor by which the cells grow at a time; smaller is closer to `max_share`, and slower
_MAX_GROWTH_STEPS = 24  # Most times that they grow; 24 times 1.5 is a factor of 17,000, the whole cloud
_NUM_BISECTIONS = 8  # Steps of the search for the first cell; 8 leave it uncertain by 4 %
_MAX_HALVINGS = 14  # The search begins between the extent of the cloud and this many halvings of it
_SAMPLE_SIZE = 40000  # Points that the search counts, about: it bounds the time on large clouds
_FLAT_NEIGHBORS = 10
"""Neighbors of which a sparse point is one plane with; below 8, points in the air look flat by chance."""
_KEPT_SHARE = 0.5  # A sparse point stays, too, where more than this share of its neighbors do ..
_MAX_LONELINESS = 1.5
"""... and it is at most this many times farther from its neighbors than they from theirs."""


@dataclass(frozen=True)
class SparsePointsConfig:
    """Which points count as isolated (`find_sparse_points`)."""

    # a point is sparse where its cell holds fewer points than this. 2 finds single points, 3 pairs as well.
    threshold: int = 3
    # largest share of the points that may be sparse, where `cell` is None: the cells grow until it is met. An
    # outdoor cloud, whose density falls with the distance, would lose what is far away otherwise. 0 finds
    # nothing.
    max_share: float = 0.03
    # a sparse point stays where its neighbors are as sparse as itself and lie on a plane: a far wall. Their
    # least variance over the largest is below this then; that of points in the air is 0.1 to 0.5. 0 keeps
    # none.
    flatness: float = 0.04

    def __post_init__(self) -> None:
        if not 0 <= self.max_share <= 1:
            raise ScanError(f"max_share must be from 0 to 1, got {self.max_share}")
        if not self.flatness >= 0:
            raise ScanError(f"flatness must not be negative, got {self.flatness}")
        if self.threshold < 1:
            raise ScanError(f"threshold must be 1 or more, got {self.threshold}")


def as_points(points: ArrayLike) -> Float[np.ndarray, "N 3"]:
    """Return the points as an array `[N, 3]`, without rows that are not finite."""
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"points must be numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise ScanError(f"points must have shape [N, 3], not {array.shape}")
    finite = np.isfinite(array).all(axis=1)
    return array if finite.all() else array[finite]


def crop(points: ArrayLike, box: ArrayLike, margin: float = 0.05) -> Float[np.ndarray, "M 3"]:
    """Keep the points in a box.

    Args:
        points: `[N, 3]` [m].
        box: `[[x, y, z lowest], [x, y, z highest]]` [m].
        margin: added below and above the box, not at its sides [m]: readings of a floor lie on both sides of it.

    Raises:
        ScanError: the points or the box have another shape, or its corners another order.
    """
    points, box = as_points(points), np.asarray(box, dtype=np.float64)
    if box.shape != (2, 3) or not (box[0] <= box[1]).all():
        raise ScanError(f"box must be [[lowest], [highest]] corner, shape (2, 3), not {box.tolist()}")
    border = np.array([0.0, 0.0, margin])
    return points[((points >= box[0] - border) & (points <= box[1] + border)).all(axis=1)]


def thin(points: ArrayLike, voxel: float) -> Float[np.ndarray, "M 3"]:
    """Replace the points of every cube by their mean; the cubes' edges are `voxel` [m] long.

    Raises:
        ScanError: `voxel` is not above 0, or so small that the cubes cannot be counted.
    """
    points = as_points(points)
    if not 0 < voxel < np.inf:
        raise ScanError(f"voxel must be above 0, got {voxel}")
    if not len(points):
        return points
    keys = compute_cell_keys(points, voxel)
    _, index, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(index.ravel(), points[:, k]) / counts for k in range(3)], axis=1)


def find_sparse_points(points: ArrayLike, config: SparsePointsConfig | None = None) -> Bool[np.ndarray, " N"]:
    """Find the points whose cell of a 3-D histogram holds fewer points than a threshold.

    The count of a point is the higher one of two histograms, shifted against each other by half a cell. Where the
    cells are found from the density, points that are part of a sparse surface stay (`SparsePointsConfig.flatness`).
    """
    config = config or SparsePointsConfig()
    points = as_points(points)
    if len(points) < 4 * _POINTS_PER_CELL or not np.ptp(points, axis=0).any():  # too few for a density
        return np.zeros(len(points), bool)
    cell = _find_cell(points)
    for _ in range(_MAX_GROWTH_STEPS):
        is_sparse = _count_in_cells(points, cell) < config.threshold
        if is_sparse.mean() <= config.max_share:
            is_sparse[is_sparse] = ~_find_flat(points, is_sparse, config)
            return is_sparse
        cell *= _CELL_GROWTH
    return np.zeros(len(points), bool)


def _find_flat(
    points: Float[np.ndarray, "N 3"], is_sparse: Bool[np.ndarray, " N"], config: SparsePointsConfig
) -> Bool[np.ndarray, " S"]:
    """Return which of the sparse points lie with their neighbors on a plane, as sparse as these."""
    chosen = np.flatnonzero(is_sparse)
    if not config.flatness:
        return np.zeros(len(chosen), bool)
    is_flat, is_alike, neighbors, _ = find_flat(
        points, chosen, _FLAT_NEIGHBORS, config.flatness, _MAX_LONELINESS
    )
    is_kept = ~is_sparse
    is_kept[chosen] = is_flat
    # The edge of a far wall is not flat itself, but most of its neighbors are.
    return is_flat | (is_alike & (is_kept[neighbors].mean(axis=1) > _KEPT_SHARE))


def _find_cell(points: Float[np.ndarray, "N 3"]) -> float:
    """Return the edge at which cells hold `_POINTS_PER_CELL` points, found on every n-th point."""
    high = float(np.ptp(points, axis=0).max())
    low = high / 2.0**_MAX_HALVINGS
    stride = max(1, len(points) // _SAMPLE_SIZE)
    sample = points[::stride]
    for _ in range(_NUM_BISECTIONS):
        cell = float(np.sqrt(low * high))
        others = (_count_in_cells(sample, cell, shifts=(0.0,)).mean() - 1) * stride
        low, high = (cell, high) if others < _POINTS_PER_CELL - 1 else (low, cell)
    return high


def _count_in_cells(
    points: Float[np.ndarray, "N 3"], cell: float, shifts: tuple[float, ...] = (0.0, 0.5)
) -> Int[np.ndarray, " N"]:
    """Count the points in the cell of every point, the most of all shifts [cells].

    Cells share a table of counters (Teschner et al. 2003, spatial hashing): now and then two cells are counted as
    one, and an isolated point is kept.
    """
    counts = np.zeros(len(points), np.int64)
    num_bits = (_COUNTERS_PER_POINT * len(points)).bit_length()
    table = 1 << int(np.clip(num_bits, _MIN_TABLE_BITS, _MAX_TABLE_BITS))
    scaled = (points - points.min(axis=0)) / cell
    for shift in shifts:
        place = (scaled + shift).astype(np.int64)
        place *= _HASH_PRIMES
        hashed = (place[:, 0] ^ place[:, 1] ^ place[:, 2]) & (table - 1)
        np.maximum(counts, np.bincount(hashed, minlength=table)[hashed], out=counts)
    return counts


def compute_cell_keys(points: Float[np.ndarray, "N 3"], cell: float) -> Int[np.ndarray, " N"]:
    """Return a number for each point, that of its cell."""
    place = np.floor((points - points.min(axis=0)) / cell)
    size = place.max(axis=0) + 1
    if size.prod() > _MAX_CELLS:
        raise ScanError(
            f"cells of {cell:g} m are too small for an extent of {np.ptp(points, axis=0).max():g} m"
        )
    x, y, z = place.astype(np.int64).T
    return (x * int(size[1]) + y) * int(size[2]) + z
