"""Cropping and thinning of clouds and of bare points; the box that holds most of a scan."""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans import cells
from reconstruction._src.scans.cloud import Cloud

_NUM_CELLS = 32
"""Most cells along the longest side of the cloud. 32: parts of a scan that are apart by more than about a
thirtieth of it count as separate; more cells tear what a scanner sees only sparsely."""
_POINTS_PER_CELL = 12
"""Where points share their cell with fewer than this in the mean, cells are made larger: smaller ones would be
empty by chance."""
_MIN_POINTS = 3  # Points of an occupied cell; fewer are a stray reading, or a glimpse through a window
_MIN_SHARE = 0.05  # Parts with at least this share of the points are kept
_REFINE_BELOW = 0.125
"""Where the rest is shorter than this share of the cloud, the cells were too large for it, and the search is
repeated inside. 1/8 is four cells of 32."""
_MAX_STEPS = 12  # Most repetitions; each divides the size by 8 at least


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
        return cells.crop(points, box, margin)
    low, high = _check_box(box)
    border = np.array([0.0, 0.0, margin])
    return points.select(_find_inside(points.points, low - border, high + border))


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
        return cells.thin(points, voxel)
    if not 0 < voxel < math.inf:
        raise ScanError(f"voxel must be above 0, got {voxel}")
    if not points.num_points:
        return points
    _, index, counts = np.unique(
        cells.compute_cell_keys(points.points, voxel), return_inverse=True, return_counts=True
    )
    index = index.ravel()
    colors, seen_from = points.colors, points.seen_from
    return points.replace(
        points=_compute_means(points.points, index, counts),
        colors=None if colors is None else np.round(_compute_means(colors, index, counts)).astype(np.uint8),
        seen_from=None if seen_from is None else _find_most_frequent(seen_from, index),
    )


def find_crop_box(points: ArrayLike | Cloud) -> Float[np.ndarray, "2 3"]:
    """Return a box without the few points that are far from all others [m]: `[[lowest], [highest]]`.

    Space is divided into cells; occupied cells that touch form parts. The box holds the parts with a share of the
    points, and a cell around them.

    Args:
        points: `[N, 3]` [m].
        config: cells and shares.

    Raises:
        ScanError: the points have another shape, or there are none.
    """
    array = cells.as_points(points.points if isinstance(points, Cloud) else points)
    if not len(array):
        raise ScanError("there are no points to crop to")
    inside = array
    for _ in range(_MAX_STEPS):
        extent = float(np.ptp(inside, axis=0).max())
        if not extent:
            break
        is_chosen, cell = _select_large_parts(inside, extent)
        chosen = inside[is_chosen]
        if not len(chosen):
            break
        low, high = chosen.min(axis=0) - cell, chosen.max(axis=0) + cell
        inside = inside[_find_inside(inside, low, high)]
        if np.ptp(inside, axis=0).max() >= _REFINE_BELOW * extent:
            break
    return np.stack([inside.min(axis=0), inside.max(axis=0)])


def _select_large_parts(
    points: Float[np.ndarray, "N 3"], extent: float
) -> tuple[Bool[np.ndarray, " N"], float]:
    """Return which points lie in parts of touching cells that hold a share of all points, and the cells' edge."""
    from scipy import ndimage

    num_cells = _NUM_CELLS
    counts, place = _count(points, extent, num_cells)
    while num_cells > 1 and counts[place].mean() < _POINTS_PER_CELL:
        num_cells //= 2
        counts, place = _count(points, extent, num_cells)
    parts, _ = ndimage.label(counts >= _MIN_POINTS, np.ones((3, 3, 3)))  # type: ignore[misc]
    part = np.asarray(parts)[place]
    sizes = np.bincount(part)
    sizes[0] = 0
    large = np.flatnonzero(sizes >= max(_MIN_SHARE * len(points), 1))
    return np.isin(part, large), extent / num_cells


def _count(
    points: Float[np.ndarray, "N 3"], extent: float, num_cells: int
) -> tuple[Int[np.ndarray, "X Y Z"], tuple[np.ndarray, ...]]:
    """Return the number of points in each cell, and the cell of each point."""
    place = np.minimum((points - points.min(axis=0)) / extent * num_cells, num_cells - 1).astype(np.int64)
    shape, index = tuple(place.max(axis=0) + 1), tuple(place.T)
    counts = np.bincount(np.ravel_multi_index(index, shape), minlength=math.prod(shape))
    return counts.reshape(shape), index


def _check_box(box: ArrayLike) -> Float[np.ndarray, "2 3"]:
    corners = np.asarray(box, dtype=np.float64)
    if corners.shape != (2, 3) or not (corners[0] <= corners[1]).all():
        raise ScanError(f"box must be [[lowest], [highest]] corner, shape (2, 3), not {corners.tolist()}")
    return corners


def _find_inside(
    points: Float[np.ndarray, "N 3"], low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"]
) -> Bool[np.ndarray, " N"]:
    return np.asarray(((points >= low) & (points <= high)).all(axis=1))


def _compute_means(
    values: np.ndarray, index: Int[np.ndarray, " N"], counts: Int[np.ndarray, " M"]
) -> Float[np.ndarray, "M 3"]:
    return np.stack([np.bincount(index, values[:, k]) / counts for k in range(3)], axis=1)


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
