"""Convex solids of a terrain as intersections of half-spaces."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float, Num
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from reconstruction.geometry.hulls import make_hull

STEEP = 0.34
"""Half-spaces whose normal rises less than this (70 degrees) are sides, not tops."""
_SAME_PLANE = 1e-4
"""Two faces of a solid whose planes differ by less over its extent are one [m]."""
_SMALLEST_BALL, _LARGEST_BALL = 1e-4, 100.0
"""Radius of the ball inside a solid [m]: below the first it is flat; the second bounds what an open one would hold."""
_OPEN = 1e4
"""Corners farther from the inside than this are those of an open intersection [m]."""
_DECIMALS = 6
"""Corners that agree to a micrometre are one."""
_LEVEL = 1e-6
"""Planes whose normal rises less are upright, within the error of floats."""
_ON_PLANE = 1e-9
"""How far outside an upright side a point still counts as inside [m]."""


def find_halfspaces(piece: trimesh.Trimesh) -> Float[np.ndarray, "H 4"]:
    """Return the half-spaces of a convex solid: inside is a x + b y + c z + d <= 0; large faces first."""
    hull = ConvexHull(np.asarray(piece.vertices, dtype=np.float64))
    corners = hull.points[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = float(np.linalg.norm(hull.points - hull.points.mean(axis=0), axis=1).max())
    kept: list[np.ndarray] = []
    for normal in hull.equations[np.argsort(-areas, kind="stable"), :3]:
        if all(np.abs(normal - other[:3]).max() > _SAME_PLANE / size for other in kept):
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
    halfspaces: Float[np.ndarray, "H 4"], inner: Float[np.ndarray, " 3"]
) -> trimesh.Trimesh | None:
    """Return the solid within half-spaces around a point inside; None where it is open or flat."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            corners = HalfspaceIntersection(halfspaces, inner).intersections
    except (QhullError, ValueError):
        return None
    if not np.isfinite(corners).all() or np.abs(corners - inner).max() > _OPEN:
        return None
    return make_hull(np.unique(np.round(corners, _DECIMALS), axis=0))


def find_tops(
    halfspaces: Float[np.ndarray, "H 4"], points: Num[np.ndarray, "N 2"]
) -> Float[np.ndarray, " N"]:
    """Return the height of a solid's top at points in plan; -inf outside of it."""
    rise = halfspaces[:, 2]
    level = points @ halfspaces[:, :2].T + halfspaces[:, 3]
    is_up, is_down = rise > _LEVEL, rise < -_LEVEL
    top = (-level[:, is_up] / rise[is_up]).min(axis=1, initial=np.inf)
    bottom = (-level[:, is_down] / rise[is_down]).max(axis=1, initial=-np.inf)
    is_inside = (level[:, ~(is_up | is_down)] <= _ON_PLANE).all(axis=1) & (top >= bottom)
    return np.where(is_inside, top, -np.inf)
