"""Which points lie in a box: axis by axis, so that an axis is compared only where those before it agree."""

import numpy as np
from jaxtyping import Float, Int, Num

from reconstruction._src.geometry.rows import find_extent


def find_inside(
    points: Float[np.ndarray, "N 3"], low: Num[np.ndarray, " 3"], high: Num[np.ndarray, " 3"]
) -> Int[np.ndarray, " M"]:
    """Return the points in the box between two corners: ascending indices."""
    along = points[:, 0]
    inside = np.flatnonzero((along >= low[0]) & (along <= high[0]))
    for axis in (1, 2):
        along = points[inside, axis]
        inside = inside[(along >= low[axis]) & (along <= high[axis])]
    return inside


def find_near_box(
    points: Float[np.ndarray, "N 3"], others: Float[np.ndarray, "M 3"], margin: float
) -> Int[np.ndarray, " K"]:
    """Return the points in the box around others, widened by a margin: ascending indices."""
    low, high = find_extent(others)
    return find_inside(points, low - margin, high + margin)
