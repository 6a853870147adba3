"""What new readings say about a surface that is known already: agreed, moved, new, or gone.

Both networks refine by this: only what the readings contradict learns anew, the rest stays put.
"""

from typing import NamedTuple

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

TOLERANCE = 4.0
"""A reading farther from the surface than this many times the usual distance disagrees."""
MIN_READINGS = 3
"""So many readings must disagree near a unit before it is believed."""
COMPLETE = 0.8
"""New readings on this share of the surface are taken for a whole new scan: what they do not show is gone."""
DISAGREEING_SHARE = 0.3
"""A vertex has moved where more than this share of its new readings disagree."""
NUM_PROBES = 1000
NUM_SECTORS = 12


class Evidence(NamedTuple):
    """New readings, compared with a surface.

    Attributes:
        distance: `[M]` of each new reading from the surface [m].
        tolerance: the distance up to which a reading agrees [m].
        is_moved: `[V]` vertices whose new readings disagree with the surface.
        is_gone: `[V]` vertices without new readings though what surrounds them was read again.
    """

    distance: np.ndarray
    tolerance: float
    is_moved: np.ndarray
    is_gone: np.ndarray


def weigh_evidence(
    vertices: np.ndarray, faces: np.ndarray, old_points: np.ndarray, new_points: np.ndarray, spacing: float
) -> Evidence:
    """Compare new readings with a surface.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]`.
        old_points: `[N, 3]` what the surface was made from: they tell its usual distance from a reading.
        new_points: `[M, 3]` the new readings.
        spacing: mean distance between neighbouring vertices.
    """
    probes = old_points[:: max(1, len(old_points) // NUM_PROBES)]
    asked = np.concatenate([new_points, probes])
    found = igl.point_mesh_squared_distance(asked, np.ascontiguousarray(vertices), faces.astype(np.int64))
    squared, nearest, closest = (np.asarray(part) for part in found)
    distance = np.sqrt(np.maximum(squared, 0))
    corners = vertices[faces[nearest[: len(new_points)]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    height = np.abs(((new_points - closest[: len(new_points)]) * normal).sum(axis=1))
    usual = float(np.mean(distance[len(new_points) :]))
    distance, tolerance = distance[: len(new_points)], TOLERANCE * usual
    tree = KDTree(vertices)
    # Readings just beyond the rim of a surface say nothing against it.
    disagreeing = new_points[(height > tolerance) | (distance > spacing)]
    is_moved = np.zeros(len(vertices), dtype=bool)
    if len(disagreeing) >= MIN_READINGS:
        is_moved = _find_moved(tree, vertices, new_points, disagreeing, spacing)
    is_read = find_read(vertices, new_points, spacing)
    is_gone = find_gone(vertices, faces, new_points, is_read | is_moved, spacing)
    return Evidence(distance, tolerance, is_moved, is_gone)


def find_read(vertices: np.ndarray, new_points: np.ndarray, spacing: float) -> np.ndarray:
    """Return which vertices have a new reading as near as the readings' density lets expect: `[V]`."""
    tree = KDTree(new_points)
    probes = new_points[:: max(1, len(new_points) // NUM_PROBES)]
    usual = float(np.median(tree.query(probes, k=min(5, len(new_points)))[0][:, -1]))
    return tree.query(vertices)[0] < 1.5 * usual + spacing


def find_gone(
    vertices: np.ndarray, faces: np.ndarray, new_points: np.ndarray, is_read: np.ndarray, spacing: float
) -> np.ndarray:
    """Return which vertices are gone: not read again, though what surrounds them was.

    A connected patch without readings is gone if new readings lie on all sides of it (in the plane in which
    it extends most), or if nearly all of the surface was read again. Else it was only out of sight.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]`.
        new_points: `[M, 3]`.
        is_read: `[V]`.
        spacing: mean distance between neighbouring vertices.
    """
    is_gone = np.zeros(len(vertices), dtype=bool)
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[faces] = True
    missing = is_used & ~is_read
    if not missing.any():
        return is_gone
    if is_read[is_used].mean() >= COMPLETE:
        return missing
    pairs = np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]])
    pairs = pairs[missing[pairs].all(axis=1)]
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(vertices), len(vertices)))
    label = connected_components(graph, directed=False)[1]
    for part in np.unique(label[missing]):
        patch = vertices[missing & (label == part)]
        if len(patch) >= 3 and _is_surrounded(patch, new_points, spacing):
            is_gone |= missing & (label == part)
    return is_gone


def _is_surrounded(patch: np.ndarray, readings: np.ndarray, spacing: float) -> bool:
    """Tell whether in each of twelve directions there are readings just beyond the patch."""
    center = patch.mean(axis=0)
    axes = np.linalg.svd(patch[:4096] - center, full_matrices=False)[2][:2]
    inside, inside_sector = _to_polar((patch - center) @ axes.T)
    around, around_sector = _to_polar((readings - center) @ axes.T)
    extent = np.zeros(NUM_SECTORS)
    np.maximum.at(extent, inside_sector, inside)
    gap = around - extent[around_sector]
    is_beyond = (gap > 0) & (gap < extent.max() + 6 * spacing)
    return len(np.unique(around_sector[is_beyond])) == NUM_SECTORS


def _to_polar(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distance from the origin and number of the sector."""
    angle = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) % 1.0
    return np.linalg.norm(points, axis=1), np.minimum((angle * NUM_SECTORS).astype(int), NUM_SECTORS - 1)


def _find_moved(
    tree: KDTree, vertices: np.ndarray, new_points: np.ndarray, disagreeing: np.ndarray, spacing: float
) -> np.ndarray:
    """Return which vertices win mostly readings that disagree, enough of them within their neighbourhood."""
    nearest = np.asarray(tree.query(disagreeing)[1])
    crowd = KDTree(disagreeing).query_ball_point(disagreeing, 3 * spacing, return_length=True)
    against = np.bincount(nearest[crowd >= MIN_READINGS], minlength=len(vertices))
    candidates = np.flatnonzero(against)
    everything = np.bincount(tree.query(new_points)[1], minlength=len(vertices))
    is_moved = np.zeros(len(vertices), dtype=bool)
    is_moved[candidates] = against[candidates] > DISAGREEING_SHARE * everything[candidates]
    return is_moved
