"""The ground of a scan from the air, where its file does not say which points are ground."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage
from scipy.spatial import cKDTree

_CELL = 1.0  # Edge of a cell of the grid of lowest points [m]; larger where a row has more cells than `_MAX_CELLS`
_MAX_CELLS = 2000
_WINDOWS = (3, 5, 9, 17, 33)  # Cells; the last is wider than a house
_AROUND = 17  # Cells in which an error has no two lower ones near it
_SLOPE = 1.0  # Steepest ground
_LEAST, _MOST = 0.3, 2.5  # Lowest and highest step that may be ground [m]
_NEIGHBORS = 8  # Cells of ground from which what is hidden is interpolated


def find_heights_above_ground(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Return the height of each point above the ground below it [m].

    The lowest points of a grid are opened by ever larger windows: what stands out by more than ground of that size
    would is none.

    Args:
        points: in meters with z up, all finite.

    References:
        Zhang et al. (2003), "A progressive morphological filter for removing nonground measurements from airborne
        LIDAR data", IEEE Transactions on Geoscience and Remote Sensing 41(4), section III.
    """
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    cell = max(_CELL, float((high - low).max()) / _MAX_CELLS)
    place = (points[:, :2] - low) / cell
    row, column = np.floor(place).astype(np.int64).T
    lowest = np.full((row.max() + 1, column.max() + 1), np.inf)
    np.minimum.at(lowest, (row, column), points[:, 2])
    is_ground = np.isfinite(lowest)
    # Single points far below all around them are errors.
    is_ground &= lowest > ndimage.rank_filter(_fill(lowest, is_ground), 2, _AROUND) - _MOST
    surface, before = _fill(lowest, is_ground), 1
    for window in _WINDOWS:
        opened = ndimage.grey_opening(surface, window)
        is_ground &= surface - opened <= min(_SLOPE * (window - before) * cell + _LEAST, _MOST)
        surface, before = opened, window
    known, missing = np.argwhere(is_ground), np.argwhere(~is_ground)
    if len(missing):
        distance, index = cKDTree(known).query(missing, k=range(1, 1 + min(_NEIGHBORS, len(known))))
        weight = distance**-2.0
        lowest[tuple(missing.T)] = (lowest[is_ground][index] * weight).sum(axis=1) / weight.sum(axis=1)
    return points[:, 2] - ndimage.map_coordinates(lowest, place.T - 0.5, order=1, mode="nearest")


def _fill(heights: Float[np.ndarray, "H W"], is_known: Bool[np.ndarray, "H W"]) -> Float[np.ndarray, "H W"]:
    """Return heights in which what is not known is as high as the nearest that is."""
    nearest = ndimage.distance_transform_edt(~is_known, return_distances=False, return_indices=True)
    return heights[tuple(np.asarray(nearest))]
