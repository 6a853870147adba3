"""Shapes in plan: convex outlines, found, cut and measured; rectangles of cells."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.spatial import ConvexHull, QhullError

_MAX_CORNERS = 24
"""Corners of an outline: a prism on it keeps below 64 vertices, the most that MuJoCo's hulls should have."""
_SMALL_CORNER = 1e-5  # A corner that takes a smaller share of the area with it is left out


def find_outline(mesh: trimesh.Trimesh, bounds: Float[np.ndarray, "B 3"]) -> Float[np.ndarray, "P 2"] | None:
    """Return the convex outline of the part of a mesh within bounds, counter-clockwise; None without an area."""
    triangles = np.asarray(mesh.triangles)[:, :, :2]
    for a, b, c in bounds:
        triangles = _cut_triangles(triangles, np.array([a, b]), c)
    return compute_hull_outline(triangles.reshape(-1, 2))


def _cut_triangles(
    triangles: Float[np.ndarray, "T 3 2"], normal: Float[np.ndarray, " 2"], offset: float
) -> Float[np.ndarray, "S 3 2"]:
    """Return the corners of triangles cut by a line, as (degenerate) triangles: enough for a hull."""
    level = triangles @ normal - offset
    whole = triangles[(level <= 0).all(axis=1)]
    crossing = triangles[((level <= 0).any(axis=1)) & ((level > 0).any(axis=1))]
    if not len(crossing):
        return whole
    level = crossing @ normal - offset
    corners = []
    for i in range(3):
        j = (i + 1) % 3
        inside = level[:, i] <= 0
        corners.append(crossing[inside, i])
        crosses = inside != (level[:, j] <= 0)
        share = level[crosses, i] / (level[crosses, i] - level[crosses, j])
        corners.append(crossing[crosses, i] + share[:, None] * (crossing[crosses, j] - crossing[crosses, i]))
    return np.concatenate([whole, np.repeat(np.concatenate(corners)[:, None], 3, axis=1)])


def compute_hull_outline(points: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "P 2"] | None:
    """Return the convex hull of points, counter-clockwise, of few corners; None without an area."""
    if len(points) < 3:
        return None
    try:
        hull = points[ConvexHull(points).vertices]
    except QhullError:
        return None
    while len(hull) > 3:
        loss = _measure_corners(hull)
        corner = int(np.argmin(loss))
        if len(hull) <= _MAX_CORNERS and loss[corner] > _SMALL_CORNER * measure_area(hull):
            break
        hull = np.delete(hull, corner, axis=0)
    return hull


def measure_area(polygon: Float[np.ndarray, "P 2"]) -> float:
    """Return the area of a simple polygon, above 0 where it is counter-clockwise."""
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def compute_bounds(outline: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, "P 3"]:
    """Return the lines (a, b, c) of a convex, counter-clockwise outline; inside is a x + b y <= c."""
    side = np.roll(outline, -1, axis=0) - outline
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.concatenate([normal, np.sum(normal * outline, axis=1, keepdims=True)], axis=1)


def is_within(outline: Float[np.ndarray, "P 2"], points: Float[np.ndarray, "N 2"]) -> Bool[np.ndarray, " N"]:
    """Return which points lie in a convex, counter-clockwise outline."""
    bounds = compute_bounds(outline)
    return np.all(points @ bounds[:, :2].T <= bounds[:, 2], axis=1)


def _measure_corners(polygon: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, " P"]:
    """Return the area of the triangle that each corner makes with its neighbors."""
    before, after = np.roll(polygon, 1, axis=0) - polygon, np.roll(polygon, -1, axis=0) - polygon
    return 0.5 * np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])


def find_largest_rectangle(is_free: Bool[np.ndarray, "R C"]) -> tuple[int, int, int, int]:
    """Return first row and column and those behind the last of the largest rectangle of free cells; zeros for none."""
    columns = is_free.shape[1]
    place = np.arange(columns)
    height, left, right = np.zeros(columns, np.int64), np.zeros(columns, np.int64), np.full(columns, columns)
    most, best = 0, (0, 0, 0, 0)
    for row, free in enumerate(is_free):
        # The widest rectangle that reaches up from each cell as far as there are free ones.
        height = np.where(free, height + 1, 0)
        begins = np.maximum.accumulate(np.where(free, 0, place + 1))
        ends = np.minimum.accumulate(np.where(free, columns, place)[::-1])[::-1]
        left = np.where(free, np.maximum(left, begins), 0)
        right = np.where(free, np.minimum(right, ends), columns)
        area = height * (right - left)
        k = int(np.argmax(area))
        if area[k] > most:
            most, best = int(area[k]), (row + 1 - int(height[k]), int(left[k]), row + 1, int(right[k]))
    return best
