"""Selecting points of clouds and of bare arrays: cropping, thinning, isolated points, the box of most of a scan."""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike
from scipy import ndimage
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ScanError
from reconstruction._src.geometry.rows import find_inside
from reconstruction._src.scans.cloud import Cloud

_MAX_CELLS = 2.0**62  # Numbers of cells are 64-bit integers
_POINTS_PER_CELL = 12  # In the mean: by chance a cell has fewer than 3 in 1 of 5,000 cases (Poisson)

_HASH_PRIMES = np.array([73856093, 19349663, 83492791])  # Of Teschner et al. 2003
_COUNTERS_PER_POINT = 16  # So a cell shares its counter in 1 of 16 cases at most, up to 260,000 points
_MIN_TABLE_BITS, _MAX_TABLE_BITS = 12, 22  # Bounds of the size of the table: 4 million counters take 32 MB
_CELL_GROWTH = 1.5  # Factor by which the cells grow at a time; smaller is closer to `max_share`, and slower
_MAX_GROWTH_STEPS = 24  # Most times that they grow; 24 times 1.5 is a factor of 17,000, the whole cloud
_NUM_BISECTIONS = 8  # Steps of the search for the first cell; 8 leave it uncertain by 4 %
_MAX_HALVINGS = 14  # The search begins between the extent of the cloud and this many halvings of it
_SAMPLE_SIZE = 40000  # Points that the search counts, about: it bounds the time on large clouds
_FLAT_NEIGHBORS = 10  # Neighbors on a plane with a sparse point; fewer look flat by chance
_FLATNESS = 0.04  # Their least variance over the largest is below this then; in the air it is 0.1 to 0.5
_KEPT_SHARE = 0.5  # A sparse point stays, too, where more than this share of its neighbors do ..
_MAX_LONELINESS = 1.5  # ... and is at most so many times farther from its neighbors than they from theirs

_NUM_CELLS = 32  # Most cells along the longest side: more tear what a scanner sees only sparsely
_MIN_POINTS = 3  # Points of an occupied cell; fewer are a stray reading, or a glimpse through a window
_MIN_SHARE = 0.05  # Parts with at least this share of the points are kept
_REFINE_BELOW = 0.125  # Where less of the length is left, cells were too large, and it is done again
_MAX_STEPS = 12  # Most repetitions; each divides the size by 8 at least


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


@overload
def crop(points: Cloud, box: ArrayLike, margin: float = 0.05) -> Cloud: ...  # pyright: ignore[reportOverlappingOverload]
@overload
def crop(points: ArrayLike, box: ArrayLike, margin: float = 0.05) -> np.ndarray: ...
def crop(points: Cloud | ArrayLike, box: ArrayLike, margin: float = 0.05) -> Cloud | np.ndarray:
    """Keep the points in a box.

    Args:
        points: `[N, 3]` [m], or a cloud: its colors and viewpoints are kept with its points.
        box: `[[x, y, z lowest], [x, y, z highest]]` in the frame of the points [m].
        margin: added below and above the box, not at its sides [m]: readings of a floor lie on both sides of it.

    Raises:
        ScanError: the points or the box have another shape, or its corners another order.
    """
    if not isinstance(points, Cloud):
        return crop(Cloud(as_points(points)), box, margin).points
    corners = np.asarray(box, dtype=np.float64)
    if corners.shape != (2, 3) or not (corners[0] <= corners[1]).all():
        raise ScanError(f"box must be [[lowest], [highest]] corner, shape (2, 3), not {corners.tolist()}")
    border = np.array([0.0, 0.0, margin])
    return points.select(find_inside(points.points, corners[0] - border, corners[1] + border))


@overload
def thin(points: Cloud, voxel: float) -> Cloud: ...  # pyright: ignore[reportOverlappingOverload]
@overload
def thin(points: ArrayLike, voxel: float) -> np.ndarray: ...
def thin(points: Cloud | ArrayLike, voxel: float) -> Cloud | np.ndarray:
    """Replace the points of every cube by their mean; the cubes' edges are `voxel` [m] long.

    Of a cloud the colors are averaged, too; the mean counts as seen from the viewpoint of most of its points, of
    equally many the first.

    Raises:
        ScanError: `voxel` is not above 0, or so small that the cubes cannot be counted.
    """
    if not isinstance(points, Cloud):
        return thin(Cloud(as_points(points)), voxel).points
    if not 0 < voxel < math.inf:
        raise ScanError(f"voxel must be above 0, got {voxel}")
    if not points.num_points:
        return points
    _, index, counts = np.unique(
        compute_cell_keys(points.points, voxel), return_inverse=True, return_counts=True
    )

    def average(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(index, values[:, k]) / counts for k in range(3)], axis=1)

    colors, seen_from = points.colors, points.seen_from
    return points.replace(
        points=average(points.points),
        colors=None if colors is None else np.round(average(colors)).astype(np.uint8),
        seen_from=None if seen_from is None else _find_most_frequent(seen_from, index),
    )


def compute_cell_keys(points: Float[np.ndarray, "N 3"], cell: float) -> Int[np.ndarray, " N"]:
    """Return a number for each point, that of its cube."""
    place = np.floor((points - points.min(axis=0)) / cell)
    size = place.max(axis=0) + 1
    if size.prod() > _MAX_CELLS:
        extent = np.ptp(points, axis=0).max()
        raise ScanError(f"cells of {cell:g} m are too small for an extent of {extent:g} m")
    x, y, z = place.astype(np.int64).T
    return (x * int(size[1]) + y) * int(size[2]) + z


def _find_most_frequent(
    seen_from: Int[np.ndarray, " N"], index: Int[np.ndarray, " N"]
) -> Int[np.ndarray, " M"]:
    """Return the most frequent viewpoint of the points of each cell, of equally frequent ones the first."""
    width = int(seen_from.max()) + 1
    pairs, counts = np.unique(index * width + seen_from, return_counts=True)
    cell, viewpoint = pairs // width, pairs % width
    order = np.lexsort((viewpoint, -counts, cell))  # by cell, then frequent ones first
    _, first = np.unique(cell[order], return_index=True)
    return viewpoint[order][first]


def find_crop_box(points: ArrayLike | Cloud) -> Float[np.ndarray, "2 3"]:
    """Return a box without the few points that are far from all others [m]: `[[lowest], [highest]]`.

    Space is divided into cells; occupied cells that touch form parts. The box holds the parts with a share of the
    points, and a cell around them.

    Args:
        points: `[N, 3]` [m].

    Raises:
        ScanError: the points have another shape, or there are none.
    """
    inside = as_points(points.points if isinstance(points, Cloud) else points)
    if not len(inside):
        raise ScanError("there are no points to crop to")
    for _ in range(_MAX_STEPS):
        extent = float(np.ptp(inside, axis=0).max())
        if not extent:
            break
        is_chosen, cell = _select_large_parts(inside, extent)
        chosen = inside[is_chosen]
        if not len(chosen):
            break
        low, high = chosen.min(axis=0) - cell, chosen.max(axis=0) + cell
        inside = inside[find_inside(inside, low, high)]
        if np.ptp(inside, axis=0).max() >= _REFINE_BELOW * extent:
            break
    return np.stack([inside.min(axis=0), inside.max(axis=0)])


def _select_large_parts(
    points: Float[np.ndarray, "N 3"], extent: float
) -> tuple[Bool[np.ndarray, " N"], float]:
    """Return which points lie in parts of touching cells that hold a share of all points, and the cells' edge."""
    num_cells = _NUM_CELLS
    while True:  # larger cells where these would be empty by chance
        place = (points - points.min(axis=0)) / extent * num_cells
        place = np.minimum(place, num_cells - 1).astype(np.int64)
        shape, cell = tuple(place.max(axis=0) + 1), tuple(place.T)
        index = np.ravel_multi_index(cell, shape)
        counts = np.bincount(index, minlength=math.prod(shape))
        if num_cells == 1 or counts[index].mean() >= _POINTS_PER_CELL:
            break
        num_cells //= 2
    parts, _ = ndimage.label((counts >= _MIN_POINTS).reshape(shape), np.ones((3, 3, 3)))  # type: ignore[misc]
    part = np.asarray(parts)[cell]
    sizes = np.bincount(part)
    sizes[0] = 0
    large = np.flatnonzero(sizes >= max(_MIN_SHARE * len(points), 1))
    return np.isin(part, large), extent / num_cells


def find_sparse_points(
    points: Float[np.ndarray, "N 3"], threshold: int = 3, max_share: float = 0.03, keep_flat: bool = True
) -> Bool[np.ndarray, " N"]:
    """Find the points whose cell of a 3-D histogram holds fewer points than a threshold.

    The count of a point is the higher one of two histograms, shifted against each other by half a cell. The cells
    grow until at most a share of the points is sparse: an outdoor cloud, whose density falls with the distance, would
    lose what is far away otherwise. With `keep_flat` a sparse point stays where its neighbors are as sparse as itself
    and lie on a plane: a far wall.
    """
    if len(points) < 4 * _POINTS_PER_CELL or not np.ptp(points, axis=0).any():  # too few for a density
        return np.zeros(len(points), bool)
    cell = _find_cell(points)
    for _ in range(_MAX_GROWTH_STEPS):
        is_sparse = _count_in_cells(points, cell) < threshold
        if is_sparse.mean() <= max_share:
            break
        cell *= _CELL_GROWTH
    else:
        return np.zeros(len(points), bool)
    if keep_flat:
        chosen = np.flatnonzero(is_sparse)
        is_flat, is_alike, neighbors, _ = find_flat(points, chosen, _FLAT_NEIGHBORS, _FLATNESS)
        is_kept = ~is_sparse
        is_kept[chosen] = is_flat
        # The edge of a far wall is not flat itself, but most of its neighbors are.
        is_sparse[chosen] = ~(is_flat | (is_alike & (is_kept[neighbors].mean(axis=1) > _KEPT_SHARE)))
    return is_sparse


def find_flat(
    points: Float[np.ndarray, "N 3"], chosen: Int[np.ndarray, " S"], num_neighbors: int, max_flatness: float
) -> tuple[Bool[np.ndarray, " S"], Bool[np.ndarray, " S"], Int[np.ndarray, "S K"], Float[np.ndarray, "S 3"]]:
    """Find which chosen points are as sparse as their neighbors and on a plane with them, and which are as sparse.

    Returns both, the indices of the neighbors, and the normals of the planes through them.
    """
    num_neighbors = min(num_neighbors, len(points) - 1)
    if not len(chosen) or num_neighbors < 1:
        none = np.zeros(len(chosen), bool)
        return none, none, np.zeros((len(chosen), 1), np.int64), np.zeros((len(chosen), 3))
    tree = cKDTree(points)
    distances, neighbors = tree.query(points[chosen], k=num_neighbors + 1)
    others = np.unique(neighbors)
    reach = np.zeros(len(points))
    reach[others] = tree.query(points[others], k=num_neighbors + 1)[0][:, -1]
    offset = points[neighbors] - points[neighbors].mean(axis=1, keepdims=True)
    variance, axes = np.linalg.eigh(np.swapaxes(offset, 1, 2) @ offset)
    is_alike = distances[:, -1] < _MAX_LONELINESS * np.median(reach[neighbors], axis=1)
    is_flat = is_alike & (variance[:, 0] < max_flatness * variance[:, 2])
    return is_flat, is_alike, neighbors[:, 1:], axes[:, :, 0]


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
