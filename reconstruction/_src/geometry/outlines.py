"""Convex outlines in plan: found, cut, measured."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
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


_LONGEST = 5.0
"""A sliver: its edge at the rim is longer than this many median edges of the surface: a network leaves none ..."""
_MIN_ANGLE_DEG = 120.0  # ... and its corner off the rim has an angle above this [degrees]: it is low ...
_MIN_BEND_DEG = 10.0
"""... and it is bent against its neighbors by more than this [degrees]: a low triangle of flat ground is part
of the ground."""
_ROUNDS = 20  # Slivers behind slivers are removed, too, in no more rounds than these


def drop_rim_slivers(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Int[np.ndarray, "G 3"]:
    """Return the faces without slivers at the rim, which bridge ground that no vertex stands for."""
    lengths = _compute_lengths(vertices, faces)
    longest = _LONGEST * float(np.median(lengths)) if len(faces) else 0.0
    for _ in range(_ROUNDS):
        is_sliver = _find_slivers(vertices, faces, longest)
        if not is_sliver.any() or is_sliver.all():
            break
        faces = faces[~is_sliver]
    return faces


def _compute_lengths(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "F 3"]:
    """Return the length of the edge opposite of every corner [m]."""
    corners = vertices[faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)


def _find_slivers(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], longest: float
) -> Bool[np.ndarray, " F"]:
    lengths = _compute_lengths(vertices, faces)
    rows, corner = np.arange(len(faces)), lengths.argmax(axis=1)
    long = lengths[rows, corner]
    others = np.sort(lengths, axis=1)[:, :2]
    # Law of cosines at the corner opposite of the longest edge.
    cosine = (others[:, 0] ** 2 + others[:, 1] ** 2 - long**2) / (2.0 * others[:, 0] * others[:, 1])
    is_low = (long > longest) & (cosine < np.cos(np.radians(_MIN_ANGLE_DEG)))
    if not is_low.any():
        return is_low
    ends = np.sort(np.stack([faces[rows, corner - 2], faces[rows, corner - 1]], axis=1), axis=1)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    rim = {(int(a), int(b)) for a, b in unique[count == 1]}
    is_rim = np.array([pair in rim for pair in map(tuple, ends.tolist())], dtype=bool)
    return is_low & is_rim & (_compute_bends(vertices, faces) > np.radians(_MIN_BEND_DEG))


def _compute_bends(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, " F"]:
    """Return the largest angle of each face with a neighbor [rad]."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    angles = np.asarray(mesh.face_adjacency_angles)
    bends = np.zeros(len(faces))
    np.maximum.at(bends, pairs.ravel(), np.repeat(angles, 2))
    return bends
