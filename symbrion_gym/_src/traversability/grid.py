"""A grid of square cells in plan, and the triangles above their centers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

_LEAST_AREA = 1e-12  # Triangles with less in plan are vertical [m²]
_MOST_PAIRS = 2_000_000  # Pairs of triangle and cell that are treated at once: bounds the memory
_ROUNDING = 1e-9  # Centers of cells this close outside a triangle lie in it [m]: neighbors leave no crack


class Grid(NamedTuple):
    """Square cells, numbered row by row: cell = i * shape[1] + j."""

    low: tuple[float, float]  # (x, y) of the lower corner of the first cell [m]
    cell: float  # edge of a cell [m]
    shape: tuple[int, int]  # number of cells along x and y

    @property
    def num_cells(self) -> int:
        """Number of cells."""
        return self.shape[0] * self.shape[1]

    def compute_cells(self, places: Float[np.ndarray, "N 2"]) -> Int[np.ndarray, " N"]:
        """Return the cell of each (x, y); -1 beyond the grid."""
        is_known = np.isfinite(places[:, 0] + places[:, 1])
        i, j = (
            np.floor((np.where(is_known, places[:, k], 0.0) - self.low[k]) / self.cell).astype(np.int64)
            for k in range(2)
        )
        is_inside = is_known & (i >= 0) & (i < self.shape[0]) & (j >= 0) & (j < self.shape[1])
        return np.where(is_inside, i * self.shape[1] + j, -1)

    def compute_centers(self, cells: Int[np.ndarray, " N"]) -> Float[np.ndarray, "N 2"]:
        """Return (x, y) of the centers of cells [m]."""
        steps = np.stack(np.divmod(cells, self.shape[1]), axis=1)
        return np.asarray(self.low) + (steps + 0.5) * self.cell

    def find_neighbors(
        self, cells: Int[np.ndarray, " N"], along_x: int, along_y: int
    ) -> Int[np.ndarray, " N"]:
        """Return the cells that lie some cells farther; -1 beyond the grid."""
        i, j = np.divmod(cells, self.shape[1])
        i, j = i + along_x, j + along_y
        is_inside = (i >= 0) & (i < self.shape[0]) & (j >= 0) & (j < self.shape[1])
        return np.where(is_inside, i * self.shape[1] + j, -1)


def make_grid(
    low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"], cell: float, max_cells: int
) -> Grid:
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


def find_crossings(grid: Grid, corners: Float[np.ndarray, "T 3 3"], margin: float = 0.0) -> Crossings:
    """Return where vertical lines through the centers of cells meet triangles, triangle by triangle."""
    margin = max(margin, _ROUNDING)
    first, last = (
        np.clip(rounded.astype(np.int64), [0, 0], np.asarray(grid.shape) - 1 + shift)
        for rounded, shift in (
            (np.ceil((corners[..., :2].min(axis=1) - margin - grid.low) / grid.cell - 0.5), 1),
            (np.floor((corners[..., :2].max(axis=1) + margin - grid.low) / grid.cell - 0.5), 0),
        )
    )
    spans = np.maximum(last - first + 1, 0)
    is_flat = np.abs(_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) > 2 * _LEAST_AREA
    spans[~is_flat] = 0
    parts = [
        _cross_some(grid, corners, margin, triangles, first, spans)
        for triangles in _split(spans.prod(axis=1), _MOST_PAIRS)
    ]
    if not parts:
        return Crossings(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    return Crossings(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def expand(counts: Int[np.ndarray, " N"]) -> tuple[Int[np.ndarray, " M"], Int[np.ndarray, " M"]]:
    """Return for `counts[i]` things of each i: the i of each, and its number among them."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def _split(counts: Int[np.ndarray, " N"], most: int) -> Iterator[Int[np.ndarray, " M"]]:
    """Yield numbers of those with a count above 0, in groups whose counts add up to about `most`."""
    used = np.flatnonzero(counts > 0)
    if len(used):
        group = np.cumsum(counts[used]) // most
        yield from np.split(used, np.flatnonzero(np.diff(group)) + 1)


def _cross_some(
    grid: Grid,
    corners: Float[np.ndarray, "T 3 3"],
    margin: float,
    triangles: Int[np.ndarray, " N"],
    first: Int[np.ndarray, "T 2"],
    spans: Int[np.ndarray, "T 2"],
) -> Crossings:
    owner, number = expand(spans[triangles].prod(axis=1))
    triangle = triangles[owner]
    i, j = np.divmod(number, spans[triangle, 1])
    i, j = first[triangle, 0] + i, first[triangle, 1] + j
    cell = i * grid.shape[1] + j
    place = np.asarray(grid.low) + (np.stack([i, j], axis=1) + 0.5) * grid.cell
    shape = corners[triangle]
    is_inside = _is_inside(place, shape[..., :2], margin)
    triangle, cell, place, shape = (values[is_inside] for values in (triangle, cell, place, shape))
    side_1, side_2, way = shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0], place - shape[:, 0, :2]
    area = _cross(side_1, side_2)
    height = shape[:, 0, 2] + (_cross(way, side_2) * side_1[:, 2] + _cross(side_1, way) * side_2[:, 2]) / area
    return Crossings(triangle, cell, np.clip(height, shape[..., 2].min(axis=1), shape[..., 2].max(axis=1)))


def _is_inside(
    place: Float[np.ndarray, "N 2"], shape: Float[np.ndarray, "N 3 2"], margin: float
) -> Bool[np.ndarray, " N"]:
    """Return whether places lie in triangles that are larger by a margin."""
    turn = np.sign(_cross(shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0]))
    is_inside = np.ones(len(place), dtype=bool)
    for k in range(3):
        edge = shape[:, (k + 1) % 3] - shape[:, k]
        is_inside &= turn * _cross(edge, place - shape[:, k]) >= -margin * np.hypot(edge[:, 0], edge[:, 1])
    return is_inside


def _cross(one: Float[np.ndarray, "N d"], other: Float[np.ndarray, "N e"]) -> Float[np.ndarray, " N"]:
    """Return the z component of the cross product."""
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
