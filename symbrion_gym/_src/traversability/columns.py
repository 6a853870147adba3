"""What is solid above and below the cells of a grid: walls, and spans as of Recast's height field (Mononen 2009)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.contact.kinds import FIELD_BASE, HeightField

Cells = Int[np.ndarray, " N"]  # Numbers of cells; -1 for none
Heights = Float[np.ndarray, " N"]  # [m]
Triangles = Float[np.ndarray, "T 3 3"]  # corners [m]
Margins = Float[np.ndarray, " T"]  # of triangles [m]
Corner = Float[np.ndarray, " 2"]  # (x, y) [m]
Spots = Int[np.ndarray, "T 2"]  # steps in cells along x and y

_LEAST_AREA = 1e-12  # Triangles with less in plan are vertical [m²]
_MOST_PAIRS = 2_000_000  # Pairs of triangle and cell that are treated at once: bounds the memory
_ROUNDING = 1e-9  # Centers of cells this close outside a triangle lie in it [m]: neighbors leave no crack
_WALL_DETAIL = 0.005  # Points of walls in a cell whose heights differ by less are one [m]
_CRACK = 0.002  # Gaps between contact pieces up to this height are none [m]
_GAP = 0.0065  # Ground reaches so far beyond its rim [m]: tracks of a radius of 0.02 sink 1 mm into a gap of twice it
_WALL_SLOPE = float(np.deg2rad(50.0))
"""Steeper faces are walls, also where they are thinner than a cell [rad]."""


class Grid(NamedTuple):
    """Square cells, numbered row by row: cell = i * shape[1] + j."""

    low: tuple[float, float]  # (x, y) of the lower corner of the first cell [m]
    cell: float  # edge of a cell [m]
    shape: tuple[int, int]  # number of cells along x and y

    @property
    def num_cells(self) -> int:
        """Number of cells."""
        return self.shape[0] * self.shape[1]

    def compute_cells(self, places: Float[np.ndarray, "N 2"]) -> Cells:
        """Return the cell of each (x, y); -1 beyond the grid."""
        is_known = np.isfinite(places[:, 0] + places[:, 1])
        steps = np.floor((np.where(is_known[:, None], places, self.low) - self.low) / self.cell)
        return np.where(is_known, self._number(*steps.astype(np.int64).T), -1)

    def compute_centers(self, cells: Cells) -> Float[np.ndarray, "N 2"]:
        """Return (x, y) of the centers of cells [m]."""
        steps = np.stack(np.divmod(cells, self.shape[1]), axis=1)
        return np.asarray(self.low) + (steps + 0.5) * self.cell

    def find_neighbors(self, cells: Cells, along_x: int, along_y: int) -> Cells:
        """Return the cells that lie some cells farther; -1 beyond the grid."""
        i, j = np.divmod(cells, self.shape[1])
        return self._number(i + along_x, j + along_y)

    def _number(self, i: Cells, j: Cells) -> Cells:
        is_inside = (i >= 0) & (i < self.shape[0]) & (j >= 0) & (j < self.shape[1])
        return np.where(is_inside, i * self.shape[1] + j, -1)


def make_grid(low: Corner, high: Corner, cell: float, max_cells: int) -> Grid:
    """Return a grid over a rectangle; its cells are wider than `cell` where there would be too many."""
    extent = np.maximum(np.asarray(high, dtype=np.float64) - low, cell)
    cell = max(cell, float(np.sqrt(np.prod(extent) / max_cells)))
    shape = np.maximum(np.ceil(extent / cell - _ROUNDING).astype(np.int64), 1)
    start = (np.asarray(low, dtype=np.float64) + high - shape * cell) / 2
    return Grid((float(start[0]), float(start[1])), cell, (int(shape[0]), int(shape[1])))


class Crossings(NamedTuple):
    """Where vertical lines through the centers of cells meet triangles."""

    triangle: Int[np.ndarray, " C"]  # number of the triangle
    cell: Int[np.ndarray, " C"]  # number of the cell
    height: Float[np.ndarray, " C"]  # z of the triangle there [m]


def find_crossings(grid: Grid, corners: Triangles, margin: Margins | float = 0.0) -> Crossings:
    """Return where vertical lines through the centers of cells meet triangles, each wider by a margin [m]."""
    margin = np.broadcast_to(np.maximum(margin, _ROUNDING), len(corners))
    low, high = (corners[..., :2].min(axis=1).T - margin).T, (corners[..., :2].max(axis=1).T + margin).T
    last_cell = np.asarray(grid.shape) - 1
    first = np.clip(np.ceil((low - grid.low) / grid.cell - 0.5).astype(np.int64), 0, last_cell + 1)
    last = np.clip(np.floor((high - grid.low) / grid.cell - 0.5).astype(np.int64), 0, last_cell)
    counts = np.maximum(last - first + 1, 0)
    is_flat = np.abs(_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) > 2 * _LEAST_AREA
    counts[~is_flat] = 0
    used = np.flatnonzero(counts.prod(axis=1))
    group = np.cumsum(counts[used].prod(axis=1)) // _MOST_PAIRS
    parts = [
        _cross_some(grid, corners, margin, some, first, counts)
        for some in np.split(used, np.flatnonzero(np.diff(group)) + 1)
    ]
    return Crossings(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _expand(counts: Int[np.ndarray, " N"]) -> tuple[Int[np.ndarray, " M"], Int[np.ndarray, " M"]]:
    """Return for `counts[i]` things of each i: the i of each, and its number among them."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def _cross_some(
    grid: Grid, corners: Triangles, margin: Margins, some: Cells, first: Spots, counts: Spots
) -> Crossings:
    """Return the crossings of some triangles with the cells from their first one on, so many along x and y."""
    owner, number = _expand(counts[some].prod(axis=1))
    triangle = some[owner]
    steps = first[triangle] + np.stack(np.divmod(number, counts[triangle, 1]), axis=1)
    cell = steps[:, 0] * grid.shape[1] + steps[:, 1]
    place, shape = np.asarray(grid.low) + (steps + 0.5) * grid.cell, corners[triangle]
    turn = np.sign(_cross(shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0]))
    is_inside = np.ones(len(place), dtype=bool)
    for k in range(3):
        edge, way = shape[:, (k + 1) % 3, :2] - shape[:, k, :2], place - shape[:, k, :2]
        is_inside &= turn * _cross(edge, way) >= -margin[triangle] * np.hypot(edge[:, 0], edge[:, 1])
    triangle, cell, place, shape = (values[is_inside] for values in (triangle, cell, place, shape))
    side_1, side_2, way = shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0], place - shape[:, 0, :2]
    area = _cross(side_1, side_2)
    height = shape[:, 0, 2] + (_cross(way, side_2) * side_1[:, 2] + _cross(side_1, way) * side_2[:, 2]) / area
    return Crossings(triangle, cell, np.clip(height, shape[..., 2].min(axis=1), shape[..., 2].max(axis=1)))


def _cross(one: Float[np.ndarray, "N d"], other: Float[np.ndarray, "N e"]) -> Float[np.ndarray, " N"]:
    """Return the z component of the cross product."""
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


class SortedHeights:
    """Heights in cells, sorted by cell, then height (`order`), so that many searches are one."""

    def __init__(self, cells: Cells, heights: Heights) -> None:
        """Sort cells and heights."""
        self.order = np.lexsort((heights, cells))
        self.cells, self.heights = cells[self.order], heights[self.order]
        self._low = float(heights.min()) - 1.0 if len(heights) else 0.0
        self._range = (float(heights.max()) - self._low + 1.0) if len(heights) else 1.0
        self._keys = self._find_keys(self.cells, self.heights)

    def _find_keys(self, cells: Cells, heights: Heights) -> Float[np.ndarray, " N"]:
        return cells * self._range + np.clip(heights - self._low, 0.0, self._range)

    def count_below(self, cells: Cells, heights: Heights) -> Int[np.ndarray, " N"]:
        """Return how many are in earlier cells, or in the same cell and lower."""
        return np.searchsorted(self._keys, self._find_keys(cells, heights))

    def find_nearest(self, cells: Cells, heights: Heights) -> Int[np.ndarray, " N"]:
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


def find_spans(grid: Grid, pieces: list[trimesh.Trimesh], height_field: HeightField | None) -> Spans:
    """Return what is solid along the vertical lines through the centers of cells."""
    corners = _join_triangles(pieces)
    owner = np.repeat(np.arange(len(pieces)), [len(piece.faces) for piece in pieces])
    # The sides of pieces do not reach beyond their edges: their planes rise too fast.
    found = find_crossings(grid, corners, np.where(_find_steep(corners), 0.0, _GAP))
    key = owner[found.triangle] * grid.num_cells + found.cell
    order = np.argsort(key, kind="stable")
    key, height = key[order], found.height[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    cell = key[starts] % grid.num_cells
    low, high = (
        each.reduceat(height, starts) if len(starts) else height for each in (np.minimum, np.maximum)
    )
    if height_field is not None:
        ground = find_crossings(grid, np.asarray(height_field.as_mesh().triangles))
        base = np.full(len(ground.cell), float(height_field.heights.min()) - FIELD_BASE)
        cell = np.concatenate([cell, ground.cell])
        low, high = np.concatenate([low, base]), np.concatenate([high, ground.height])
    # Intervals of a cell that overlap or nearly touch are one.
    if not len(cell):
        return Spans(cell, low, high, high)
    order = np.lexsort((low, cell))
    cell, low, high = cell[order], low[order], high[order]
    rank = np.cumsum(np.diff(cell, prepend=cell[0]) > 0)
    lift = rank * (high.max() - low.min() + 1.0)  # earlier cells never reach into later ones
    reached = np.maximum.accumulate(high + lift) - lift
    is_first = np.ones(len(cell), dtype=bool)
    is_first[1:] = (np.diff(cell) > 0) | (low[1:] > reached[:-1] + _CRACK)
    starts = np.flatnonzero(is_first)
    cell, low, high = cell[starts], low[starts], np.maximum.reduceat(high, starts)
    clearance = np.full(len(cell), np.inf)
    is_below = cell[1:] == cell[:-1]
    clearance[:-1][is_below] = (low[1:] - high[:-1])[is_below]
    return Spans(cell, low, high, clearance)


def _join_triangles(pieces: list[trimesh.Trimesh]) -> Triangles:
    return np.concatenate([np.zeros((0, 3, 3)), *(np.asarray(piece.triangles) for piece in pieces)])


def _find_steep(corners: Triangles) -> Bool[np.ndarray, " T"]:
    """Return which triangles are walls."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.abs(normal[:, 2]) < np.cos(_WALL_SLOPE) * np.linalg.norm(normal, axis=1)


def find_walls(grid: Grid, pieces: list[trimesh.Trimesh]) -> SortedHeights:
    """Return heights of points all over the steep faces of pieces, in their cells.

    Walls thinner than a cell lie between the lines through the centers, where `find_spans` does not see them.
    """
    corners = _join_triangles(pieces)
    walls = _sample(corners[_find_steep(corners)], grid.cell / 2)
    cells = grid.compute_cells(walls[:, :2])
    level = np.floor(walls[:, 2] / _WALL_DETAIL).astype(np.int64)
    level -= level.min(initial=0)
    _, kept = np.unique(cells * (level.max(initial=0) + 1) + level, return_index=True)
    kept = kept[cells[kept] >= 0]
    return SortedHeights(cells[kept], walls[kept, 2])


def _sample(corners: Triangles, spacing: float) -> Float[np.ndarray, "N 3"]:
    """Return points all over triangles, no farther apart than a spacing, rims included."""
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = (edges.argmin(axis=1)[:, None] + np.arange(3)) % 3  # the first two corners: of the shortest edge
    one, other, tip = (corners[np.arange(len(corners)), turn[:, k]] for k in range(3))
    across = np.ceil(edges.min(axis=1) / spacing).astype(np.int64)
    along = np.ceil(edges.max(axis=1) / spacing).astype(np.int64)
    owner, number = _expand((across + 1) * (along + 1))
    i, j = np.divmod(number, across[owner] + 1)
    u, v = i / np.maximum(along[owner], 1), j / np.maximum(across[owner], 1)
    base = one[owner] + v[:, None] * (other - one)[owner]
    return tip[owner] + u[:, None] * (base - tip[owner])
