"""Where a grid has no data: cells that it has drawn out over a hole do not belong to the surface."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.rows import find_lengths

STRETCHED = 2.0
"""Only cells with a side so many times the median are looked at: where there are points, units are, too."""
MAX_VOID = 0.5
"""A cell of which a larger share lies far from all points is no surface."""
_NUM_NEAR = 10


def find_covered_cells(units: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return which cells belong to the surface: not those drawn out over a hole without points, `[R - 1, C - 1]`.

    Args:
        units: `[R, C, 3]`.
        points: `[N, 3]` what they have learnt from.
    """
    down = find_lengths(np.diff(units, axis=0))
    across = find_lengths(np.diff(units, axis=1))
    sides = np.stack([down[:, :-1], down[:, 1:], across[:-1], across[1:]])
    longest, typical = sides.max(axis=0), float(np.median(sides))
    is_covered = longest <= STRETCHED * typical
    row, column = np.nonzero(~is_covered)
    if len(row) == 0:
        return is_covered
    # Nine places in each cell; what lies far from all points there, lies over a hole.
    share = np.array([0.2, 0.5, 0.8])
    s, t = (a.ravel()[:, None, None] for a in np.meshgrid(share, share))
    upper = (1 - t) * units[row, column] + t * units[row, column + 1]
    lower = (1 - t) * units[row + 1, column] + t * units[row + 1, column + 1]
    places = (1 - s) * upper + s * lower
    tree = cKDTree(points)
    distances, nearest = tree.query(places)
    spacing = tree.query(points[nearest], k=min(_NUM_NEAR, len(points) - 1) + 1)[0][..., -1]
    is_void = distances > np.maximum(spacing, typical)
    is_covered[row, column] = is_void.mean(axis=0) < MAX_VOID
    from reconstruction.networks.growing_grid.refinement import (
        open_pinches,  # only a sheet with holes needs it
    )

    return open_pinches(is_covered)
