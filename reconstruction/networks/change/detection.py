"""What new readings say about a surface that is known already: agreed, moved, new, or gone.

Both networks refine by this: only what the readings contradict learns anew, the rest stays put.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction.geometry.boxes import find_inside, find_near_box
from reconstruction.geometry.manifold import find_normals
from reconstruction.geometry.rows import all_corners, any_corner, find_extent, find_lengths, sum_rows
from reconstruction.networks.change.free_space import find_passed

TOLERANCE = 4.0
"""A reading farther from the surface than this many times the usual distance disagrees."""
STRONG = 1.5
"""Where no few readings disagree by more than this many tolerances, the tail of the noise has spoken."""
STRONG_RINGS = 2
"""So many rings of vertices round a strong disagreement are believed with it."""
MIN_READINGS = 3
"""So many readings must disagree near a unit before it is believed."""
COMPLETE = 0.8
"""New readings on this share of the surface are taken for a whole new scan: what they do not show is gone."""
DISAGREEING_SHARE = 0.3
"""A vertex has moved where more than this share of its new readings disagree."""
SIGNIFICANCE = 3.0
"""It has not where so many disagree as the old readings let expect, within this many standard deviations."""
ABOUT = 1.2
"""Next to a point are new readings up to so many times their usual distance away."""
LEAST_COMPARED = 4096
COMPARED_PER_FACE = 3
"""Of very many new readings so many for each face suffice."""
NUM_PROBES = 1000
NUM_DENSITY_PROBES = 256
"""At so many places the density of the new readings is measured."""
FEWEST_PROBES = 100
NUM_SECTORS = 12


class Evidence(NamedTuple):
    """New readings, compared with a surface.

    Attributes:
        compared: `[C]` the new readings that were compared: all, or as many as suffice.
        winners: `[C]` the vertex nearest to each of these.
        distance: `[C]` of each of these from the surface [m].
        tolerance: the distance up to which a reading agrees [m].
        is_moved: `[V]` vertices whose new readings disagree with the surface.
        is_strong: `[V]` vertices with no few readings that disagree by more than the tail of the noise does.
        is_gone: `[V]` vertices without new readings though what surrounds them was read again, and those that
            rays pass through.
        is_read: `[V]` vertices with a new reading nearby.
        density: new readings a square metre of surface, where they are.
    """

    compared: np.ndarray
    winners: np.ndarray
    distance: np.ndarray
    tolerance: float
    is_moved: np.ndarray
    is_strong: np.ndarray
    is_gone: np.ndarray
    is_read: np.ndarray
    density: float


def weigh_evidence(
    vertices: np.ndarray,
    faces: np.ndarray,
    old_points: np.ndarray,
    new_points: np.ndarray,
    spacing: float,
    origins: np.ndarray | None = None,
) -> Evidence:
    """Compare new readings with a surface.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]`.
        old_points: `[N, 3]` what the surface was made from: they tell its usual distance from a reading.
        new_points: `[M, 3]` the new readings.
        spacing: mean distance between neighbouring vertices.
        origins: `[M, 3]` where each new reading was made from: what lies on the way there is gone.
    """
    import igl

    vertices, faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)
    about, probes = _crop(vertices, faces, old_points, new_points, 2 * spacing)
    wanted = max(LEAST_COMPARED, COMPARED_PER_FACE * len(about))
    compared = _thin(np.arange(len(new_points)), wanted)
    readings = new_points
    new_points, origins = new_points[compared], None if origins is None else origins[compared]
    surface = igl.AABB()
    surface.init(vertices, about)
    asked = np.concatenate([new_points, probes])
    squared, nearest, closest = (
        np.asarray(part) for part in surface.squared_distance(vertices, about, asked)
    )
    distance = np.sqrt(np.maximum(squared, 0))
    height = _find_heights(vertices, about, new_points, nearest, closest)
    tolerance = TOLERANCE * float(np.mean(distance[len(new_points) :]))
    distance = distance[: len(new_points)]
    winners = _find_corners(vertices, about[nearest[: len(new_points)]], new_points)
    # Readings just beyond the rim of a surface say nothing against it.
    disagrees = (height > tolerance) | (distance > spacing)
    is_moved = _find_moved(winners, new_points, disagrees, spacing, len(vertices))
    if is_moved.any():
        known = _pick_about(vertices[is_moved], old_points, spacing)
        if len(known):
            _, nearest, closest = surface.squared_distance(vertices, about, known)
            usual = _find_heights(vertices, about, known, np.asarray(nearest), np.asarray(closest))
            owners = _find_corners(vertices, about[np.asarray(nearest)], known)
            is_moved &= _is_news(winners, disagrees, owners, usual > tolerance, len(vertices))
    far = np.flatnonzero(distance > STRONG * tolerance)
    is_strong = np.zeros(len(vertices), dtype=bool)
    is_strong[winners[far[find_crowded(winners[far], new_points[far], 3 * spacing)]]] = True
    is_read, density = find_read(vertices, readings, spacing)
    is_gone = find_gone(vertices, faces, readings, is_read | is_moved, spacing)
    if origins is not None:
        agreeing = np.bincount(winners[distance <= tolerance], minlength=len(vertices))
        is_gone |= find_passed(vertices, faces, new_points, origins, agreeing, tolerance, 2 * spacing)
    return Evidence(compared, winners, distance, tolerance, is_moved, is_strong, is_gone, is_read, density)


def _crop(
    vertices: np.ndarray,
    faces: np.ndarray,
    old_points: np.ndarray,
    new_points: np.ndarray,
    margin: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces that are near new readings, and old points `[P, 3]` to compare with."""
    low, high = find_extent(new_points)
    low, high = low - margin, high + margin
    is_inside = np.zeros(len(vertices), dtype=bool)
    is_inside[find_inside(vertices, low, high)] = True
    probes = old_points[:: max(1, len(old_points) // (8 * NUM_PROBES))]
    inner = find_inside(probes, low + margin / 2, high - margin / 2)
    about = faces[any_corner(is_inside, faces)]
    if len(inner) < FEWEST_PROBES or len(about) == 0:
        return faces, _thin(probes, NUM_PROBES)
    probes = probes[inner]
    return np.ascontiguousarray(about), _thin(probes, NUM_PROBES)


def _thin(rows: np.ndarray, most: int) -> np.ndarray:
    """Return every so many-th row, not more than wanted."""
    return rows[:: max(1, -(-len(rows) // most))]


def _find_heights(
    vertices: np.ndarray, faces: np.ndarray, points: np.ndarray, nearest: np.ndarray, closest: np.ndarray
) -> np.ndarray:
    """Return how far the points are from their nearest faces along these faces' normals: `[M]`."""
    normals = find_normals(vertices, faces)[nearest[: len(points)]]
    return np.abs(np.einsum("mk,mk->m", points - closest[: len(points)], normals))


def find_read(vertices: np.ndarray, new_points: np.ndarray, spacing: float) -> tuple[np.ndarray, float]:
    """Return which vertices have a new reading as near as the readings' density lets expect, `[V]`, and that density.

    The density is in readings a square metre of surface.
    """
    tree = cKDTree(new_points, balanced_tree=False)
    probes = _thin(new_points, NUM_DENSITY_PROBES)
    near = min(5, len(new_points))
    usual = float(np.median(tree.query(probes, k=near)[0].reshape(len(probes), -1)[:, -1]))
    reach = 1.5 * usual + spacing
    is_read = np.zeros(len(vertices), dtype=bool)
    about = find_near_box(vertices, new_points, reach)
    is_read[about] = np.isfinite(tree.query(vertices[about], distance_upper_bound=reach)[0])
    return is_read, (near - 1) / max(np.pi * usual**2, 1e-300)


def find_superseded(points: np.ndarray, readings: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Return which old points `[P]` have no new reading next to them that agrees with the surface they are on.

    Args:
        points: `[P, 3]`.
        readings: `[C, 3]` the new readings that were compared.
        evidence: what came of it.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=bool)
    reach = ABOUT / np.sqrt(evidence.density)
    agreeing = find_near_box(readings, points, reach)
    agreeing = agreeing[evidence.distance[agreeing] <= evidence.tolerance]
    if len(agreeing) == 0:
        return np.ones(len(points), dtype=bool)
    tree = cKDTree(readings[agreeing], balanced_tree=False)
    return ~np.isfinite(tree.query(points, distance_upper_bound=reach)[0])


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
    low, high = find_extent(new_points)
    margin = (high - low).max() / 2 + spacing
    low, high = low - margin, high + margin
    is_within = np.zeros(len(vertices), dtype=bool)
    is_within[find_inside(vertices, low, high)] = True
    if not (missing & is_within).any():
        return is_gone
    near = faces[any_corner(missing & is_within, faces)]
    pairs = np.concatenate([near[:, :2], near[:, 1:], near[:, ::2]])
    pairs = pairs[all_corners(missing, pairs)]
    used = np.unique(np.concatenate([pairs.ravel(), np.flatnonzero(missing & is_within)]))
    ends = np.searchsorted(used, pairs)
    graph = coo_array((np.ones(len(pairs)), (ends[:, 0], ends[:, 1])), shape=(len(used), len(used)))
    label = connected_components(graph, directed=False)[1]
    for part in np.unique(label):
        patch = used[label == part]
        # A patch that goes on beyond the readings is not surrounded by them.
        if len(patch) >= 3 and is_within[patch].all():
            is_gone[patch] = _is_surrounded(vertices[patch], new_points, spacing)
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
    return find_lengths(points), np.minimum((angle * NUM_SECTORS).astype(int), NUM_SECTORS - 1)


def _find_moved(
    winners: np.ndarray, new_points: np.ndarray, disagrees: np.ndarray, spacing: float, num_vertices: int
) -> np.ndarray:
    """Return which vertices win mostly readings that disagree, enough of them within their neighbourhood."""
    against = np.flatnonzero(disagrees)
    is_crowded = find_crowded(winners[against], new_points[against], 3 * spacing)
    believed = np.bincount(winners[against[is_crowded]], minlength=num_vertices)
    everything = np.bincount(winners, minlength=num_vertices)
    return believed > DISAGREEING_SHARE * everything


def find_crowded(winners: np.ndarray, points: np.ndarray, distance: float) -> np.ndarray:
    """Return which readings are not alone: won by the vertex of enough others, or near to enough others.

    Args:
        winners: `[N]` the vertex that each reading is nearest to.
        points: `[N, 3]` the readings.
        distance: up to which others are near.
    """
    if len(points) < MIN_READINGS:
        return np.zeros(len(points), dtype=bool)
    is_crowded = np.bincount(winners)[winners] >= MIN_READINGS
    left = np.flatnonzero(~is_crowded)
    if len(left):
        tree = cKDTree(points, balanced_tree=False)
        crowd, _ = tree.query(points[left], k=MIN_READINGS, distance_upper_bound=distance)
        is_crowded[left] = np.isfinite(crowd[:, -1])
    return is_crowded


def _find_corners(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return of each point's nearest face `[M, 3]` the corner nearest to it: `[M]`."""
    squared = sum_rows((vertices[faces] - points[:, None]) ** 2)
    return faces[np.arange(len(faces)), squared.argmin(axis=1)]


def _pick_about(vertices: np.ndarray, points: np.ndarray, spacing: float) -> np.ndarray:
    """Return the points nearer to one of the vertices than the spacing, not more than are needed to judge them."""
    inside = points[_thin(find_near_box(points, vertices, spacing), 4 * NUM_PROBES)]
    distance, _ = cKDTree(vertices).query(inside, distance_upper_bound=spacing)
    return inside[_thin(np.flatnonzero(np.isfinite(distance)), NUM_PROBES)]


def _is_news(
    winners: np.ndarray,
    disagrees: np.ndarray,
    owners: np.ndarray,
    has_disagreed: np.ndarray,
    num_vertices: int,
) -> np.ndarray:
    """Return at which vertices clearly more of the new readings disagree than did of the old: `[V]`.

    A coarse mesh cuts corners: there readings disagree though nothing has changed.
    """
    before, now = (np.bincount(to, minlength=num_vertices).astype(np.float64) for to in (owners, winners))
    were_against, are_against = (
        np.bincount(to, weights, minlength=num_vertices)
        for to, weights in ((owners, has_disagreed), (winners, disagrees))
    )
    expected = were_against / np.maximum(before, 1) * now
    share = (were_against + 0.5) / (before + 1)
    # Both counts scatter: what is expected is known no better than the old readings tell.
    variance = share * (1 - share) * now * (1 + now / np.maximum(before, 1)) * (before > 0)
    return are_against - expected > SIGNIFICANCE * np.sqrt(variance + 0.25)
