"""Heights of a triangle mesh along vertical lines, many at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

_EDGE_TOLERANCE = 1e-9
"""How far outside a triangle (barycentric) a point still counts as inside: neighbors must leave no crack."""
_SEEN_AREA = 1e-12  # A triangle with less than half of this area in plan is vertical [m²]
_MOST_CELLS = 2000.0
"""Cells of the grid along the longer side: bounds its memory where triangles lie far apart."""
_LEAST_EXTENT = 1e-9  # Extent of a grid whose triangles are one point in plan [m]


class ElevationGrid(NamedTuple):
    """Triangles sorted into cells of a plan; a cell is `row * shape[1] + column`."""

    origin: Float[np.ndarray, " 2"]  # its lowest x and y [m]
    cell: float  # edge of a cell [m]
    shape: tuple[int, int]  # number of cells along x and y
    starts: Int[np.ndarray, " C1"]  # where the triangles of each cell begin in `triangles`
    triangles: Int[np.ndarray, " S"]  # rows of `table`, cell by cell
    # of each triangle corner (x, y, z), two sides from there (x, y), heights of their ends, and twice its
    # area in plan
    table: Float[np.ndarray, "T 10"]


class Elevation:
    """The highest point of meshes above every (x, y): a uniform grid of triangle lists, built once.

    Vertical triangles have no area in plan and are left out: where a wall stands, its upper rim counts.
    """

    def __init__(self, *meshes: trimesh.Trimesh) -> None:
        """Sort the triangles of all meshes into grid cells, about two for each triangle."""
        triangles = [np.asarray(mesh.triangles, dtype=np.float64) for mesh in meshes]
        corners = np.concatenate(triangles) if triangles else np.zeros((0, 3, 3))
        side_1, side_2 = (corners[:, i, :2] - corners[:, 0, :2] for i in (1, 2))
        area = side_1[:, 0] * side_2[:, 1] - side_1[:, 1] * side_2[:, 0]
        is_seen = np.abs(area) > _SEEN_AREA
        self._corners = corners[is_seen]
        self._faces = np.flatnonzero(is_seen)
        # One row a triangle with all that its height takes: one place in memory to look up.
        seen = (
            self._corners[:, 0],
            side_1[is_seen],
            side_2[is_seen],
            self._corners[:, 1:, 2],
            area[is_seen, None],
        )
        self._table = np.concatenate(seen, axis=1)
        self._make_grid()

    def _make_grid(self) -> None:
        count = len(self._corners)
        low = self._corners[:, :, :2].min(axis=1)
        high = self._corners[:, :, :2].max(axis=1)
        self._origin = low.min(axis=0) if count else np.zeros(2)
        extent = np.maximum(high.max(axis=0) - self._origin, _LEAST_EXTENT) if count else np.ones(2)
        self._cell = float(
            max(np.sqrt(extent[0] * extent[1] / max(2 * count, 1)), extent.max() / _MOST_CELLS)
        )
        self._shape = np.floor(extent / self._cell).astype(np.int64) + 1
        first, last = self._find_cells(low), self._find_cells(high)
        spans = last - first + 1
        repeats = spans.prod(axis=1)
        triangle = np.repeat(np.arange(count), repeats)
        offset = np.arange(repeats.sum()) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        row = first[triangle, 0] + offset // spans[triangle, 1]
        column = first[triangle, 1] + offset % spans[triangle, 1]
        cell = row * self._shape[1] + column
        order = np.argsort(cell, kind="stable")
        self._triangles = triangle[order]
        self._starts = np.searchsorted(cell[order], np.arange(self._shape.prod() + 1))

    def export_grid(self) -> ElevationGrid:
        """Return the grid, for code that looks up heights elsewhere, such as on a GPU."""
        rows, columns = map(int, self._shape)
        return ElevationGrid(
            self._origin, self._cell, (rows, columns), self._starts, self._triangles, self._table
        )

    def _find_cells(self, points: Float[np.ndarray, "N 2"]) -> Int[np.ndarray, "N 2"]:
        cells = np.floor((points - self._origin) / self._cell).astype(np.int64)
        return np.minimum(np.maximum(cells, 0), self._shape - 1)

    def height(self, x: ArrayLike, y: ArrayLike) -> Float[np.ndarray, " ..."]:
        """Return the height of the mesh at each (x, y) [m], NaN where there is none."""
        return self.find_top(x, y)[0]

    def height_below(self, x: ArrayLike, y: ArrayLike, limit: ArrayLike) -> Float[np.ndarray, " ..."]:
        """Return the height of the highest part of the mesh that is no higher than a limit; NaN where there is none."""
        return self.find_top(x, y, limit)[0]

    def find_top(
        self, x: ArrayLike, y: ArrayLike, limit: ArrayLike | None = None
    ) -> tuple[Float[np.ndarray, " *S"], Int[np.ndarray, " *S"]]:
        """Return the height of the mesh and the face that is highest at each (x, y); NaN and -1 for none."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        points = np.stack([x.ravel(), y.ravel()], axis=1)
        is_finite = np.isfinite(points[:, 0] + points[:, 1])
        row, column = self._find_cells(np.where(is_finite[:, None], points, self._origin)).T
        starts, stops = (self._starts.take(row * self._shape[1] + column + end) for end in (0, 1))
        counts = np.where(is_finite, stops - starts, 0)
        begins = np.cumsum(counts) - counts
        point = np.repeat(np.arange(len(points)), counts)
        triangle = self._triangles.take(np.arange(len(point)) + (starts - begins).take(point))
        z = self._height_in(triangle, points.take(point, axis=0))
        if limit is not None:
            z = np.where(z <= np.broadcast_to(limit, x.shape).ravel()[point], z, -np.inf)
        heights, faces = np.full(len(points), -np.inf), np.full(len(points), -1)
        is_covered = counts > 0
        if len(z):
            heights[is_covered] = np.maximum.reduceat(z, begins[is_covered])
        is_top = np.flatnonzero((z == heights.take(point)) & (z > -np.inf))
        faces[point[is_top]] = self._faces[triangle[is_top]]
        heights[faces < 0] = np.nan
        return heights.reshape(x.shape), faces.reshape(x.shape)

    def _height_in(
        self, triangle: Int[np.ndarray, " N"], points: Float[np.ndarray, "N 2"]
    ) -> Float[np.ndarray, " N"]:
        """Return the height of each triangle at its point, -inf outside of it (barycentric coordinates)."""
        x, y, z, b_x, b_y, c_x, c_y, b_z, c_z, area = self._table.take(triangle, axis=0).T
        to_x, to_y = points[:, 0] - x, points[:, 1] - y
        weight_b = (to_x * c_y - to_y * c_x) / area
        weight_c = (b_x * to_y - b_y * to_x) / area
        weight_a = 1.0 - weight_b - weight_c
        inside = np.minimum(np.minimum(weight_a, weight_b), weight_c) >= -_EDGE_TOLERANCE
        return np.where(inside, weight_a * z + weight_b * b_z + weight_c * c_z, -np.inf)
