"""What a scanner would have read of a surface whose scan is not known."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.ray_mesh import RayMesh

_HIDDEN = 1e-3
"""A point of a surface is hidden where the surface is nearer to the viewpoint by more than this [m]."""


def simulate_readings(
    surface: trimesh.Trimesh, viewpoints: Float[np.ndarray, "K 3"], num_points: int = 20_000
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return exact readings of a surface whose scan is not known, and the viewpoint of each."""
    vertices = np.asarray(surface.vertices, dtype=np.float64)
    points = sample_area(vertices, np.asarray(surface.faces, dtype=np.int64), num_points)
    rays, found, seen_from = RayMesh([surface]), [], []
    for index, viewpoint in enumerate(viewpoints):
        ways = points - viewpoint
        ranges = np.maximum(np.linalg.norm(ways, axis=1), _HIDDEN)
        is_seen = rays.cast(np.tile(viewpoint, (len(points), 1)), ways / ranges[:, None]) >= ranges - _HIDDEN
        found.append(points[is_seen])
        seen_from.append(np.full(int(is_seen.sum()), index))
    return np.concatenate(found), np.concatenate(seen_from)
