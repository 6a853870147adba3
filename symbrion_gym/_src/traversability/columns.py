"""What is solid above and below each cell of a grid: spans of height, one above the other, and walls between them.

The spans are those of Recast's height field (Mononen 2009), from convex pieces instead of a triangle soup.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.traversability.grid import Grid, expand, find_crossings

_FIELD_BASE = 0.2  # How far a height field reaches below its lowest point [m]
_WALL_DETAIL = 0.005  # Points of walls in a cell whose heights differ by less are one [m]


class SortedHeights:
    """Heights in cells, sorted by cell, then height, so that many searches are one.

    Attributes:
        order: `[N]` the numbers of what was given, in order.
        cells: `[N]` sorted.
        heights: `[N]` sorted likewise [m].
    """

    def __init__(self, cells: Int[np.ndarray, " N"], heights: Float[np.ndarray, " N"]) -> None:
        """Sort cells and heights."""
        self.order = np.lexsort((heights, cells))
        self.cells, self.heights = cells[self.order], heights[self.order]
        self._low = float(heights.min()) - 1.0 if len(heights) else 0.0
        self._range = (float(heights.max()) - self._low + 1.0) if len(heights) else 1.0
        self._keys = self._find_keys(self.cells, self.heights)

    def _find_keys(
        self, cells: Int[np.ndarray, " M"], heights: Float[np.ndarray, " M"]
    ) -> Float[np.ndarray, " M"]:
        return cells * self._range + np.clip(heights - self._low, 0.0, self._range)

    def count_below(
        self, cells: Int[np.ndarray, " M"], heights: Float[np.ndarray, " M"]
    ) -> Int[np.ndarray, " M"]:
        """Return how many are in earlier cells, or in the same cell and lower."""
        return np.searchsorted(self._keys, self._find_keys(cells, heights))

    def find_nearest(
        self, cells: Int[np.ndarray, " M"], heights: Float[np.ndarray, " M"]
    ) -> Int[np.ndarray, " M"]:
        """Return the place in the order of what is nearest in height in a cell; -1 for none, and for cell -1."""
        if not len(self.cells):
            return np.full(len(cells), -1)
        after = self.count_below(cells, heights)
        best, gap = np.full(len(cells), -1), np.full(len(cells), np.inf)
        for candidate in (after - 1, after):
            number = np.clip(candidate, 0, len(self.cells) - 1)
            distance = np.abs(self.heights[number] - heights)
            is_nearer = (self.cells[number] == cells) & (distance < gap)
            best[is_nearer], gap[is_nearer] = number[is_nearer], distance[is_nearer]
        return best


class Spans(NamedTuple):
    """What is solid, sorted by cell, then height; spans of a cell do not touch."""

    cell: Int[np.ndarray, " S"]  # number of the cell
    low: Float[np.ndarray, " S"]  # where it begins [m]
    high: Float[np.ndarray, " S"]  # where it ends [m]
    clearance: Float[np.ndarray, " S"]  # free height above it [m]; inf under the open sky


def find_spans(
    grid: Grid, pieces: list[trimesh.Trimesh], height_field: HeightField | None, crack: float
) -> Spans:
    """Return what is solid along the vertical lines through the centers of cells."""
    cell, low, high = _find_intervals(grid, pieces, crack)
    if height_field is not None:
        ground = find_crossings(grid, np.asarray(height_field.as_mesh().triangles))
        base = np.full(len(ground.cell), float(height_field.heights.min()) - _FIELD_BASE)
        cell = np.concatenate([cell, ground.cell])
        low, high = np.concatenate([low, base]), np.concatenate([high, ground.height])
    return _merge(cell, low, high, crack)


def _find_intervals(
    grid: Grid, pieces: list[trimesh.Trimesh], margin: float
) -> tuple[Int[np.ndarray, " I"], Float[np.ndarray, " I"], Float[np.ndarray, " I"]]:
    """Return cell, lower and upper end of each piece along each vertical line that it meets."""
    if not pieces:
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    corners = np.concatenate([np.asarray(piece.triangles, dtype=np.float64) for piece in pieces])
    owner = np.repeat(np.arange(len(pieces)), [len(piece.faces) for piece in pieces])
    crossings = find_crossings(grid, corners, margin)
    key = owner[crossings.triangle] * grid.num_cells + crossings.cell
    order = np.argsort(key, kind="stable")
    key, height = key[order], crossings.height[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    if not len(starts):
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    low, high = np.minimum.reduceat(height, starts), np.maximum.reduceat(height, starts)
    return key[starts] % grid.num_cells, low, high


def _merge(
    cell: Int[np.ndarray, " I"], low: Float[np.ndarray, " I"], high: Float[np.ndarray, " I"], gap: float
) -> Spans:
    """Join intervals of a cell that overlap or nearly touch."""
    if not len(cell):
        return Spans(cell, low, high, high)
    order = np.lexsort((low, cell))
    cell, low, high = cell[order], low[order], high[order]
    rank = np.cumsum(np.diff(cell, prepend=cell[0]) > 0)
    lift = rank * (high.max() - low.min() + 1.0)  # earlier cells never reach into later ones
    reached = np.maximum.accumulate(high + lift) - lift
    is_first = np.ones(len(cell), dtype=bool)
    is_first[1:] = (np.diff(cell) > 0) | (low[1:] > reached[:-1] + gap)
    starts = np.flatnonzero(is_first)
    cell, low, high = cell[starts], low[starts], np.maximum.reduceat(high, starts)
    clearance = np.full(len(cell), np.inf)
    is_below = cell[1:] == cell[:-1]
    clearance[:-1][is_below] = (low[1:] - high[:-1])[is_below]
    return Spans(cell, low, high, clearance)


def find_walls(grid: Grid, pieces: list[trimesh.Trimesh], slope: float) -> SortedHeights:
    """Return heights of points all over the steep faces of pieces, in their cells.

    Walls thinner than a cell lie between the lines through the centers, where `find_spans` does not see them.
    """
    points = [np.zeros((0, 3))]
    if pieces:
        corners = np.concatenate([np.asarray(piece.triangles, dtype=np.float64) for piece in pieces])
        points.append(_sample(corners[_is_steep(corners, slope)], grid.cell / 2))
    walls = np.concatenate(points)
    cells = grid.compute_cells(walls[:, :2])
    level = np.floor(walls[:, 2] / _WALL_DETAIL).astype(np.int64)
    level -= level.min(initial=0)
    _, kept = np.unique(cells * (level.max(initial=0) + 1) + level, return_index=True)
    kept = kept[cells[kept] >= 0]
    return SortedHeights(cells[kept], walls[kept, 2])


def _is_steep(corners: Float[np.ndarray, "T 3 3"], slope: float) -> Bool[np.ndarray, " T"]:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.abs(normal[:, 2]) < np.cos(slope) * np.linalg.norm(normal, axis=1)


def _sample(corners: Float[np.ndarray, "T 3 3"], spacing: float) -> Float[np.ndarray, "N 3"]:
    """Return points all over triangles, no farther apart than a spacing, rims included."""
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = (edges.argmin(axis=1)[:, None] + np.arange(3)) % 3  # the first two corners: of the shortest edge
    one, other, tip = (corners[np.arange(len(corners)), turn[:, k]] for k in range(3))
    across = np.ceil(edges.min(axis=1) / spacing).astype(np.int64)
    along = np.ceil(edges.max(axis=1) / spacing).astype(np.int64)
    owner, number = expand((across + 1) * (along + 1))
    i, j = np.divmod(number, across[owner] + 1)
    u, v = i / np.maximum(along[owner], 1), j / np.maximum(across[owner], 1)
    base = one[owner] + v[:, None] * (other - one)[owner]
    return tip[owner] + u[:, None] * (base - tip[owner])
