"""The rectangles that a patch of a plane consists of; what no rectangle covers stays mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.rectangles import find_smallest_rectangle

_TRIMMED = 0.5
"""Percentage of corners that may stick out of the rectangle that gives the direction."""
_MOST_CELLS = 500
"""Cells of the grid along a side; wider ones are used beyond."""


class GridRectangle(NamedTuple):
    """A rectangle of cells: rows from `row` to `row_end`, columns likewise, the ends excluded."""

    row: int
    row_end: int
    column: int
    column_end: int


def find_rectangles(
    triangles: Float[np.ndarray, "F 3 2"],
    cell: float,
    least_area: float,
    most: int,
    is_backed: Callable[[np.ndarray], np.ndarray] | None = None,
    max_exposed: float = 0.0,
) -> list[tuple[Float[np.ndarray, " 2"], Float[np.ndarray, "2 2"], Float[np.ndarray, " 2"]]]:
    """Return rectangles that triangles cover, the largest first.

    A rectangle of covered cells grows over cells that are hidden, and over a few that are not.
    """
    around = find_smallest_rectangle(triangles.reshape(-1, 2), _TRIMMED)
    if around is None:
        return []
    turned = triangles @ around.axes
    low, high = turned.min(axis=(0, 1)), turned.max(axis=(0, 1))
    steps = np.clip(np.ceil((high - low) / cell), 1, _MOST_CELLS).astype(np.int64)
    lines = [np.linspace(low[k], high[k], steps[k] + 1) for k in range(2)]
    is_free = _find_covered(turned, lines)
    is_taken = np.zeros_like(is_free)
    is_exposed = ~is_free
    if is_backed is not None:
        middles = np.stack(
            np.meshgrid(*((line[1:] + line[:-1]) / 2 for line in lines), indexing="ij"), axis=-1
        )
        is_exposed[is_exposed] = ~is_backed(middles[is_exposed] @ around.axes.T)
    size = np.array([line[1] - line[0] for line in lines])
    found = []
    while len(found) < most:
        area, one = find_largest_rectangle(is_free)
        if area * float(size.prod()) < least_area:
            break
        one = _grow(one, is_exposed, is_taken, max_exposed)
        is_free[one.row : one.row_end, one.column : one.column_end] = False
        is_taken[one.row : one.row_end, one.column : one.column_end] = True
        first = np.array([lines[0][one.row], lines[1][one.column]])
        last = np.array([lines[0][one.row_end], lines[1][one.column_end]])
        found.append((around.axes @ (first + last) / 2, around.axes, (last - first) / 2))
    return found


def find_largest_rectangle(is_free: Bool[np.ndarray, "R C"]) -> tuple[int, GridRectangle]:
    """Return the number of cells of the largest rectangle of free cells, and where it is."""
    rows, columns = is_free.shape
    place = np.arange(columns)
    height, left, right = (
        np.zeros(columns, np.int64),
        np.zeros(columns, np.int64),
        np.full(columns, columns),
    )
    best, where = 0, GridRectangle(0, 0, 0, 0)
    for row in range(rows):
        free = is_free[row]
        height = np.where(free, height + 1, 0)
        begins = np.maximum.accumulate(np.where(free, 0, place + 1))
        ends = np.minimum.accumulate(np.where(free, columns, place)[::-1])[::-1]
        left = np.where(free, np.maximum(left, begins), 0)
        right = np.where(free, np.minimum(right, ends), columns)
        area = height * (right - left)
        k = int(np.argmax(area))
        if area[k] > best:
            best = int(area[k])
            where = GridRectangle(row + 1 - int(height[k]), row + 1, int(left[k]), int(right[k]))
    return best, where


def _grow(
    one: GridRectangle, is_exposed: Bool[np.ndarray, "R C"], is_taken: Bool[np.ndarray, "R C"], most: float
) -> GridRectangle:
    """Return a rectangle that is moved outwards, a row or column after the other, where that exposes the least.

    It ends where more than a share `most` of it would be exposed, and at cells that another rectangle has taken.
    """
    while True:
        wider = []
        for side, step in enumerate((-1, 1, -1, 1)):
            place = list(one)
            place[side] += step
            new = GridRectangle(*place)
            if min(new) < 0 or new.row_end > is_exposed.shape[0] or new.column_end > is_exposed.shape[1]:
                continue
            cells = slice(new.row, new.row_end), slice(new.column, new.column_end)
            share = float(is_exposed[cells].mean())
            if share <= most and not is_taken[cells].any():
                wider.append((share, side, new))
        if not wider:
            return one
        one = min(wider)[2]


def _find_covered(triangles: Float[np.ndarray, "F 3 2"], lines: list[np.ndarray]) -> Bool[np.ndarray, "R C"]:
    """Return which cells of a grid triangles cover at their corners and in their middle."""
    corners = np.concatenate([triangles, np.zeros((*triangles.shape[:2], 1))], axis=2)
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    ground = Elevation(mesh)
    nodes = np.isfinite(ground.height(*np.meshgrid(*lines, indexing="ij")))
    middles = [(line[1:] + line[:-1]) / 2 for line in lines]
    is_covered = np.isfinite(ground.height(*np.meshgrid(*middles, indexing="ij")))
    return is_covered & nodes[1:, 1:] & nodes[1:, :-1] & nodes[:-1, 1:] & nodes[:-1, :-1]
