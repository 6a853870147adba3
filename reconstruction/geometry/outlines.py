"""Convex outlines in plan, and the prisms that stand on them."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from reconstruction.geometry.hulls import make_hull

_MAX_CORNERS = 24
"""Corners of an outline: a prism on it keeps below 64 vertices."""


def find_outline(mesh: trimesh.Trimesh, bounds: np.ndarray) -> np.ndarray | None:
    """Return the convex outline `[P, 2]` of the part of a mesh within bounds, counter-clockwise.

    Args:
        mesh: seen from above.
        bounds: `[B, 3]` lines (a, b, c): inside is a x + b y <= c.
    """
    triangles = np.asarray(mesh.triangles)[:, :, :2]
    for a, b, c in bounds:
        triangles = _cut_triangles(triangles, np.array([a, b]), c)
    points = triangles.reshape(-1, 2)
    return hull_2d(points)


def _cut_triangles(triangles: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """Corners of triangles cut by a line, as (degenerate) triangles: enough for a hull."""
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


def hull_2d(points: np.ndarray) -> np.ndarray | None:
    """Return the convex hull of points `[N, 2]`, counter-clockwise, of few corners; None without an area."""
    if len(points) < 3:
        return None
    try:
        hull = points[ConvexHull(points).vertices]
    except QhullError:
        return None
    while len(hull) > 3:
        loss = _corner_areas(hull)
        corner = int(np.argmin(loss))
        if len(hull) <= _MAX_CORNERS and loss[corner] > 1e-5 * polygon_area(hull):
            break
        hull = np.delete(hull, corner, axis=0)
    return hull


def cut_outline(outline: np.ndarray, line: np.ndarray) -> np.ndarray | None:
    """Return the part of a convex outline where a x + b y <= c of the line (a, b, c); None without an area."""
    level = outline @ line[:2] - line[2]
    following, next_level = np.roll(outline, -1, axis=0), np.roll(level, -1)
    crosses = (level <= 0) != (next_level <= 0)
    share = level[crosses] / (level[crosses] - next_level[crosses])
    cuts = outline[crosses] + share[:, None] * (following[crosses] - outline[crosses])
    return hull_2d(np.concatenate([outline[level <= 0], cuts]))


def polygon_area(polygon: np.ndarray) -> float:
    """Return the area of a simple polygon `[P, 2]`, above 0 where it is counter-clockwise."""
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def outline_bounds(outline: np.ndarray) -> np.ndarray:
    """Return the lines `[P, 3]` of a convex, counter-clockwise outline; inside is a x + b y <= c."""
    side = np.roll(outline, -1, axis=0) - outline
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.concatenate([normal, np.sum(normal * outline, axis=1, keepdims=True)], axis=1)


def find_inside(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return which points `[N, 2]` lie in a convex, counter-clockwise outline, `[N]` bool."""
    bounds = outline_bounds(outline)
    return np.all(points @ bounds[:, :2].T <= bounds[:, 2], axis=1)


def _corner_areas(polygon: np.ndarray) -> np.ndarray:
    before, after = np.roll(polygon, 1, axis=0) - polygon, np.roll(polygon, -1, axis=0) - polygon
    return 0.5 * np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])


def cap_prism(
    bounds: np.ndarray, normals: np.ndarray, offsets: np.ndarray, bottom: float
) -> trimesh.Trimesh | None:
    """Return the convex solid above `bottom`, within bounds in plan, beneath all of some planes.

    Args:
        bounds: `[B, 3]` lines (a, b, c): inside is a x + b y <= c.
        normals: `[K, 3]` of the planes on top.
        offsets: `[K]` normal · point on them [m].
        bottom: height of the underside [m].
    """
    sides = np.stack([bounds[:, 0], bounds[:, 1], np.zeros(len(bounds)), -bounds[:, 2]], axis=1)
    tops = np.concatenate([normals, -offsets[:, None]], axis=1)
    halfspaces = np.concatenate([sides, tops, [[0.0, 0.0, -1.0, bottom]]])
    inner = _find_inner_point(halfspaces)
    if inner is None:
        return None
    try:
        corners = HalfspaceIntersection(halfspaces, inner).intersections
    except QhullError:
        return None
    solid = make_hull(np.unique(np.round(corners, 6), axis=0))
    return solid if solid is not None and solid.volume > 1e-6 else None


def _find_inner_point(halfspaces: np.ndarray) -> np.ndarray | None:
    """The point farthest inside (centre of the largest ball), by linear programming."""
    size = np.linalg.norm(halfspaces[:, :3], axis=1)
    result = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.concatenate([halfspaces[:, :3], size[:, None]], axis=1),
        b_ub=-halfspaces[:, 3],
        bounds=[(None, None)] * 3 + [(0.0, 100.0)],
    )
    return result.x[:3] if result.status == 0 and result.x[3] > 1e-4 else None
