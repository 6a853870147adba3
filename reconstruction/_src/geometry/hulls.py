"""Convex hulls of points as solids."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Num
from scipy.spatial import ConvexHull, QhullError


def make_hull(points: Num[np.ndarray, "N 3"]) -> trimesh.Trimesh | None:
    """Return the convex hull of points, faces outwards; None where they lie in a plane."""
    # Not trimesh.convex.convex_hull: the same corners in another order, in nine times the time.
    try:
        hull = ConvexHull(np.asarray(points, dtype=np.float64))
    except (QhullError, ValueError):
        return None
    corners = hull.points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    is_inwards = np.einsum("fi,fi->f", normals, hull.equations[:, :3]) < 0
    faces = np.where(is_inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    used, numbers = np.unique(faces, return_inverse=True)
    return trimesh.Trimesh(hull.points[used], numbers.reshape(-1, 3), process=False)
