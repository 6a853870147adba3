"""Convex solids as intersections of half-spaces."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from reconstruction._src.geometry.hulls import make_hull

STEEP = 0.34
"""A plane whose unit normal rises less than this (it is steeper than 70 degrees) is a side or a wall, not ground."""
_SAME_NORMAL = 1e-4
"""Normals that differ by less, relative to the size of the solid [1/m], are those of one face that Qhull split."""
_LEVEL = 1e-6
"""A unit normal that rises less belongs to a vertical plane: rounding, not slope."""
_ON_SIDE = 1e-9
"""A point this close to a vertical plane lies on it [m]."""
_SMALLEST_BALL = 1e-4
"""Solids whose largest inner ball is smaller are flat: Qhull finds no corners of them [m]."""
_LARGEST_BALL = 100.0
"""Bounds the linear program where a solid is open [m]."""
_FARTHEST = 1e4
"""A corner farther from the inner point shows that the solid is open [m]."""
_LEAST_VOLUME = 1e-6
"""A prism with less is flat [m³]; MuJoCo refuses those."""
_DIGITS = 6
"""Corners are rounded to 1 µm, so that one where many planes meet is one."""


def find_halfspaces(piece: trimesh.Trimesh) -> Float[np.ndarray, "H 4"]:
    """Return the half-spaces of a convex solid: inside is a x + b y + c z + d <= 0; large faces first."""
    hull = ConvexHull(np.asarray(piece.vertices, dtype=np.float64))
    corners = hull.points[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = float(np.linalg.norm(hull.points - hull.points.mean(axis=0), axis=1).max())
    kept: list[np.ndarray] = []
    for normal in hull.equations[np.argsort(-areas, kind="stable"), :3]:
        if all(np.abs(normal - other[:3]).max() > _SAME_NORMAL / size for other in kept):
            kept.append(np.append(normal, -(hull.points @ normal).max()))
    return np.array(kept)


def find_inner_point(halfspaces: Float[np.ndarray, "H 4"]) -> Float[np.ndarray, " 3"] | None:
    """Return the point farthest inside (center of the largest ball); None where there is no inside.

    References:
        Boyd, Vandenberghe (2004), Convex optimization, section 8.5.1: the Chebyshev center, a linear program.
    """
    size = np.linalg.norm(halfspaces[:, :3], axis=1)
    result = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.concatenate([halfspaces[:, :3], size[:, None]], axis=1),
        b_ub=-halfspaces[:, 3],
        bounds=[(None, None)] * 3 + [(0.0, _LARGEST_BALL)],
    )
    return result.x[:3] if result.status == 0 and result.x[3] > _SMALLEST_BALL else None


def make_solid(
    halfspaces: Float[np.ndarray, "H 4"], inner: Float[np.ndarray, " 3"] | None
) -> trimesh.Trimesh | None:
    """Return the solid within half-spaces around a point inside; None where it is empty, open or flat."""
    if inner is None:
        return None
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            corners = HalfspaceIntersection(halfspaces, inner).intersections
    except (QhullError, ValueError):
        return None
    if not np.isfinite(corners).all() or np.abs(corners - inner).max() > _FARTHEST:
        return None
    return make_hull(np.unique(np.round(corners, _DIGITS), axis=0))


def make_prism(
    bounds: Float[np.ndarray, "B 3"], tops: Float[np.ndarray, "K 4"], bottom: float
) -> trimesh.Trimesh | None:
    """Return the convex solid above `bottom`, within bounds in plan, beneath all of some planes."""
    sides = np.stack([bounds[:, 0], bounds[:, 1], np.zeros(len(bounds)), -bounds[:, 2]], axis=1)
    halfspaces = np.concatenate([sides, tops, [[0.0, 0.0, -1.0, bottom]]])
    solid = make_solid(halfspaces, find_inner_point(halfspaces))
    return solid if solid is not None and solid.volume > _LEAST_VOLUME else None


def find_tops(
    halfspaces: Float[np.ndarray, "H 4"], points: Float[np.ndarray, "N 2"]
) -> Float[np.ndarray, " N"]:
    """Return the height of a solid's top at points (x, y) [m]; -inf outside of it in plan."""
    rise = halfspaces[:, 2]
    level = points @ halfspaces[:, :2].T + halfspaces[:, 3]
    is_up, is_down = rise > _LEVEL, rise < -_LEVEL
    top = (-level[:, is_up] / rise[is_up]).min(axis=1, initial=np.inf)
    bottom = (-level[:, is_down] / rise[is_down]).max(axis=1, initial=-np.inf)
    is_inside = (level[:, ~(is_up | is_down)] <= _ON_SIDE).all(axis=1) & (top >= bottom)
    return np.where(is_inside, top, -np.inf)
