"""Which old points a surface still rests on, once new readings were compared with it."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import compute_vertex_normals, find_border_vertices, spread, widen
from reconstruction._src.geometry.rows import Faces, Points, Vertices, compute_lengths, sum_rows
from reconstruction._src.knowledge.changes import Change

_STRONG_RINGS = 2  # A vertex has moved only within this many rings of a vertex with strong disagreement
_MAX_EXTENSION_RISE = 0.5
"""Readings beyond the boundary that rise by less than this (sine against the surface) extend it: the old points at the
boundary are still valid."""
_NEAR_RINGS = 2
"""Old points of vertices within this many rings of a changed one are compared with the new readings themselves."""
_PLANE_READINGS = 10  # New readings that give the plane on which an old point must lie
_BESIDE = 2.0  # They lie beside it where their middle is within this many times their own spread
_MIN_CONFIRMATIONS = 4.0
"""Readings that a vertex must win on average for their absence to mean that it is gone."""


def compare(
    vertices: Vertices, faces: Faces, change: Change, old_points: Points, new_points: Float[np.ndarray, "M 3"]
) -> tuple[Bool[np.ndarray, " V"], Bool[np.ndarray, " N"]]:
    """Return which vertices have changed, and which old points are still valid.

    Points of vertices that moved or are gone are not valid, unless the surface goes on there; those near them are not
    where new readings lie on another surface. A vertex without valid points has changed, too.
    """
    is_changed = change.is_moved & widen(faces, change.is_strong, _STRONG_RINGS) | _spread_gone(faces, change)
    if not is_changed.any():
        return is_changed, np.ones(len(old_points), dtype=bool)
    is_refuted = is_changed & ~_find_extended(vertices, faces, change, new_points[change.compared])
    winners = cKDTree(vertices).query(old_points)[1]
    is_valid = ~is_refuted[winners]
    near = np.flatnonzero(is_valid & widen(faces, is_refuted, _NEAR_RINGS)[winners])
    is_valid[near] = _lie_on(old_points[near], new_points, change.tolerance)
    lost, had = (np.bincount(winners[rows], minlength=len(vertices)) for rows in (~is_valid, slice(None)))
    return is_changed | (2 * lost > had), is_valid


def _spread_gone(faces: Faces, change: Change) -> Bool[np.ndarray, " V"]:
    """Return the gone vertices with those next to them that new readings pass close by but never confirm.

    Where readings are so few that a vertex may miss its own by chance, nothing is added.
    """
    confirmations = np.bincount(change.winners[~change.disagrees], minlength=len(change.is_gone))
    has_any = confirmations > 0
    if not has_any.any() or confirmations[has_any].mean() < _MIN_CONFIRMATIONS:
        return change.is_gone
    return spread(faces, change.is_gone, change.is_read & ~has_any)


def _find_extended(
    vertices: Vertices, faces: Faces, change: Change, readings: Float[np.ndarray, "C 3"]
) -> Bool[np.ndarray, " V"]:
    """Return the vertices at the boundary beyond which new readings continue the surface."""
    winner, distant = change.winners[change.disagrees], readings[change.disagrees]
    normals = compute_vertex_normals(vertices, faces)
    normals /= np.maximum(compute_lengths(normals)[..., None], 1e-300)
    offset = distant - vertices[winner]
    rise = np.abs(sum_rows(offset * normals[winner])) / np.maximum(compute_lengths(offset), 1e-300)
    count = np.bincount(winner, minlength=len(vertices))
    flat = np.bincount(winner, rise < _MAX_EXTENSION_RISE, minlength=len(vertices))
    return find_border_vertices(faces, len(vertices)) & (flat > count / 2)


def _lie_on(
    points: Float[np.ndarray, "P 3"], readings: Float[np.ndarray, "M 3"], tolerance: float
) -> Bool[np.ndarray, " P"]:
    """Return which points lie on the plane through the nearest readings; true where these span none beside them."""
    if len(points) == 0 or len(readings) < _PLANE_READINGS:
        return np.ones(len(points), dtype=bool)
    rows = cKDTree(readings).query(points, k=_PLANE_READINGS)[1]
    middle = readings[rows].mean(axis=1)
    around = readings[rows] - middle[:, None]
    variances, axes = np.linalg.eigh(np.einsum("pki,pkj->pij", around, around) / _PLANE_READINGS)
    offset = points - middle
    height = np.abs(sum_rows(offset * axes[:, :, 0]))
    is_beside = sum_rows(offset**2) - height**2 < _BESIDE**2 * variances[:, 1:].sum(axis=1)
    return (height <= tolerance) | ~is_beside
