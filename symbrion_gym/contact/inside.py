"""Points inside convex pieces, and how deep."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float

_MOST_VALUES = 4_000_000
"""Distances of points from planes that are held at once: 32 MB."""
_PLANE_DIGITS = 9
"""Planes that agree in all of these digits are one: the triangles of a flat side share it."""
_LEAST_LENGTH = 1e-15
"""A triangle whose edges have a shorter cross product has no normal [m²]."""


def find_depths(
    points: Float[np.ndarray, "N 3"], pieces: Sequence[trimesh.Trimesh]
) -> Float[np.ndarray, " N"]:
    """Return how deep points are inside convex pieces [m]: the distance of the nearest plane, of the deepest piece.

    Args:
        points: any points [m].
        pieces: convex solids.

    Returns:
        Above 0 inside, 0 outside of all pieces.
    """
    by_extent = np.argsort(-np.ptp(points, axis=0)) if len(points) else np.arange(3)
    order = np.argsort(points[:, by_extent[0]], kind="stable")
    ordered = np.ascontiguousarray(points[order].T)
    depths = np.zeros(len(points))
    for piece in pieces:
        low, high = piece.bounds
        first, last = np.searchsorted(ordered[by_extent[0]], (low[by_extent[0]], high[by_extent[0]]))
        chosen = np.arange(first, last)
        for axis in by_extent[1:]:
            along = ordered[axis, chosen]
            chosen = chosen[(along > low[axis]) & (along < high[axis])]
        if len(chosen):
            depths[chosen] = np.maximum(depths[chosen], _find_depths_in(ordered[:, chosen].T, piece))
    unsorted = np.empty(len(points))
    unsorted[order] = depths
    return unsorted


def find_planes(piece: trimesh.Trimesh) -> Float[np.ndarray, "P 4"]:
    """Return the planes of a convex solid as outward unit normal and offset: inside, normal · x < offset."""
    corners = np.asarray(piece.triangles)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    is_flat = length[:, 0] > _LEAST_LENGTH
    normals, corner = normals[is_flat] / length[is_flat], corners[is_flat, 0]
    offsets = (normals * corner).sum(axis=1, keepdims=True)
    middle = np.asarray(piece.vertices).mean(axis=0)
    outward = np.where(normals @ middle[:, None] > offsets, -1.0, 1.0)
    return np.unique(np.round(outward * np.hstack([normals, offsets]), _PLANE_DIGITS), axis=0)


def _find_depths_in(points: Float[np.ndarray, "N 3"], piece: trimesh.Trimesh) -> Float[np.ndarray, " N"]:
    """Return the distance of the nearest plane of one piece, 0 outside."""
    planes = find_planes(piece)
    depths = np.empty(len(points))
    step = max(_MOST_VALUES // max(len(planes), 1), 1)
    for start in range(0, len(points), step):
        part = points[start : start + step]
        depths[start : start + step] = (planes[:, 3] - part @ planes[:, :3].T).min(axis=1, initial=np.inf)
    return np.maximum(depths, 0.0)
