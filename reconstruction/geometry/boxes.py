"""Which points lie in a box: axis by axis, so that each axis only looks at what the ones before have left."""

import numpy as np

from reconstruction.geometry.rows import find_extent


def find_inside(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the points `[N, 3]` in the box between two corners `[3]`: ascending indices."""
    along = points[:, 0]
    inside = np.flatnonzero((along >= low[0]) & (along <= high[0]))
    for axis in (1, 2):
        along = points[inside, axis]
        inside = inside[(along >= low[axis]) & (along <= high[axis])]
    return inside


def find_near_box(points: np.ndarray, others: np.ndarray, margin: float) -> np.ndarray:
    """Return the points `[N, 3]` in the box round others `[M, 3]`, widened by a margin: ascending indices."""
    low, high = find_extent(others)
    return find_inside(points, low - margin, high + margin)
