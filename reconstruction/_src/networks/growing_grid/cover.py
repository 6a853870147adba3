"""Where a grid has no data: cells that it has drawn out over a hole do not belong to the surface."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from reconstruction._src.base.range_checks import check_all_positive
from reconstruction._src.geometry.rows import find_lengths

_PLACES = np.array([0.2, 0.5, 0.8])
"""Along each side of a cell: nine places spread evenly over it."""


@dataclass(frozen=True)
class CoverConfig:
    """Which cells of a grid lie over a hole.

    Attributes:
        stretch: only cells with a side longer than this many median sides are tested: where there are points, units
            are, too.
        max_void: a cell of which a larger share lies far from all points is no surface.
        num_near: neighbors in the ball that measures the spacing of the points.
    """

    stretch: float = 2.0
    max_void: float = 0.5
    num_near: int = 10

    def __post_init__(self) -> None:
        check_all_positive(self)


def find_covered_cells(
    units: Float[np.ndarray, "R C 3"], points: Float[np.ndarray, "N 3"], config: CoverConfig
) -> Bool[np.ndarray, "R-1 C-1"]:
    """Return which cells belong to the surface: not those drawn out over a hole without points."""
    down = find_lengths(np.diff(units, axis=0))
    across = find_lengths(np.diff(units, axis=1))
    sides = np.stack([down[:, :-1], down[:, 1:], across[:-1], across[1:]])
    longest, typical = sides.max(axis=0), float(np.median(sides))
    is_covered = longest <= config.stretch * typical
    row, column = np.nonzero(~is_covered)
    if len(row) == 0:
        return is_covered
    s, t = (a.ravel()[:, None, None] for a in np.meshgrid(_PLACES, _PLACES))
    upper = (1 - t) * units[row, column] + t * units[row, column + 1]
    lower = (1 - t) * units[row + 1, column] + t * units[row + 1, column + 1]
    places = (1 - s) * upper + s * lower
    tree = cKDTree(points)
    distances, nearest = tree.query(places)
    spacing = tree.query(points[nearest], k=min(config.num_near, len(points) - 1) + 1)[0][..., -1]
    is_void = distances > np.maximum(spacing, typical)
    is_covered[row, column] = is_void.mean(axis=0) < config.max_void
    return open_pinches(is_covered)


def open_pinches(has_face: Bool[np.ndarray, "P Q"]) -> Bool[np.ndarray, "P Q"]:
    """Return the cells without those that touch another only at a corner, so that no vertex is pinched."""
    has_face = has_face.copy()
    while True:
        a, b, c, d = has_face[:-1, :-1], has_face[1:, :-1], has_face[1:, 1:], has_face[:-1, 1:]
        pinch_ac, pinch_bd = a & c & ~b & ~d, b & d & ~a & ~c
        if not (pinch_ac.any() or pinch_bd.any()):
            return has_face
        has_face[:-1, :-1] &= ~pinch_ac
        has_face[1:, :-1] &= ~pinch_bd
