"""Convex solids of a terrain as intersections of half-spaces."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from reconstruction.geometry.hulls import make_hull

STEEP = 0.34
"""Half-spaces whose normal rises less than this (70 degrees) are sides, not tops."""


def find_halfspaces(piece: trimesh.Trimesh) -> np.ndarray:
    """Return the half-spaces of a convex solid, `[H, 4]`: inside is a x + b y + c z + d <= 0; large faces first."""
    hull = ConvexHull(np.asarray(piece.vertices, dtype=np.float64))
    corners = hull.points[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = float(np.linalg.norm(hull.points - hull.points.mean(axis=0), axis=1).max())
    kept: list[np.ndarray] = []
    for normal in hull.equations[np.argsort(-areas, kind="stable"), :3]:
        if all(np.abs(normal - other[:3]).max() > 1e-4 / size for other in kept):
            kept.append(np.append(normal, -(hull.points @ normal).max()))
    return np.array(kept)


def find_inner_point(halfspaces: np.ndarray) -> np.ndarray | None:
    """Return the point farthest inside (centre of the largest ball); None where there is no inside.

    References:
        Boyd, Vandenberghe (2004), Convex optimization, section 8.5.1: the Chebyshev centre, a linear program.
    """
    size = np.linalg.norm(halfspaces[:, :3], axis=1)
    result = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.concatenate([halfspaces[:, :3], size[:, None]], axis=1),
        b_ub=-halfspaces[:, 3],
        bounds=[(None, None)] * 3 + [(0.0, 100.0)],
    )
    return result.x[:3] if result.status == 0 and result.x[3] > 1e-4 else None


def make_solid(halfspaces: np.ndarray, inner: np.ndarray) -> trimesh.Trimesh | None:
    """Return the solid within half-spaces around a point inside; None where it is open or flat."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            corners = HalfspaceIntersection(halfspaces, inner).intersections
    except (QhullError, ValueError):
        return None
    if not np.isfinite(corners).all() or np.abs(corners - inner).max() > 1e4:
        return None
    return make_hull(np.unique(np.round(corners, 6), axis=0))


def find_tops(halfspaces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the height of a solid's top at points `[N, 2]`; -inf beside it."""
    rise = halfspaces[:, 2]
    level = points @ halfspaces[:, :2].T + halfspaces[:, 3]
    is_up, is_down = rise > 1e-6, rise < -1e-6
    top = (-level[:, is_up] / rise[is_up]).min(axis=1, initial=np.inf)
    bottom = (-level[:, is_down] / rise[is_down]).max(axis=1, initial=-np.inf)
    is_inside = (level[:, ~(is_up | is_down)] <= 1e-9).all(axis=1) & (top >= bottom)
    return np.where(is_inside, top, -np.inf)


def strew(corners: np.ndarray, count: int) -> np.ndarray:
    """Return a grid of `count` squared points over the box around corners in plan, `[N, 2]`."""
    low, high = corners[:, :2].min(axis=0) - 1e-3, corners[:, :2].max(axis=0) + 1e-3
    axes = [np.linspace(low[i], high[i], count) for i in range(2)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
