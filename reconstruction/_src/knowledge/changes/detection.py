"""What new readings show about a surface that is known already: agreed, moved, new, or gone.

Both networks refine by this: what the readings contradict is learned again, the rest stays as it is.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import compute_normals
from reconstruction._src.geometry.rows import (
    any_corner,
    compute_extent,
    compute_lengths,
    find_inside,
    find_near_box,
    sum_rows,
)
from reconstruction._src.knowledge.changes.free_space import FACE_REACH, find_crossed_vertices, number_parts

_AXIS_SAMPLES = 4096  # As many vertices of a patch determine the plane in which it extends most


_COMPLETE_SHARE = 0.8
"""New readings on this share of the surface are taken for a whole new scan: what they do not show is gone. Lower, and
a partial scan removes what the scanner could not see."""
_NUM_SECTORS = 12
"""Directions around a patch in which readings must lie just beyond it. More, and small gaps between the readings keep
a patch that is gone."""
_RIM_WIDTH = 6.0  # Readings up to this many vertex spacings beyond the patch's extent lie just beyond it
_MIN_PATCH = 3  # Vertices of the smallest patch that can be gone; fewer miss their readings by chance
_READING_REACH = 1.5
"""A vertex is read where a new reading lies within this many times the usual distance between readings, and one
vertex spacing. Smaller, and vertices between sparse readings seem unread."""
_DENSITY_NEIGHBORS = 5  # Readings in the ball that measures the density, its center included
_NUM_DENSITY_PROBES = 256  # Places at which the density of the new readings is measured


def thin(rows: Shaped[np.ndarray, "N ..."], most: int) -> Shaped[np.ndarray, "M ..."]:
    """Return every n-th of the rows, at most `most` of them."""
    return rows[:: max(1, -(-len(rows) // most))]


def find_read(
    vertices: Float[np.ndarray, "V 3"],
    new_points: Float[np.ndarray, "M 3"],
    spacing: float,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices have a new reading as near as the density predicts."""
    tree = cKDTree(new_points, balanced_tree=False)
    probes = thin(new_points, _NUM_DENSITY_PROBES)
    near = min(_DENSITY_NEIGHBORS, len(new_points))
    usual = float(np.median(tree.query(probes, k=near)[0].reshape(len(probes), -1)[:, -1]))
    reach = _READING_REACH * usual + spacing
    is_read = np.zeros(len(vertices), dtype=bool)
    about = find_near_box(vertices, new_points, reach)
    is_read[about] = np.isfinite(tree.query(vertices[about], distance_upper_bound=reach)[0])
    return is_read


def find_gone(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    new_points: Float[np.ndarray, "M 3"],
    is_read: Bool[np.ndarray, " V"],
    spacing: float,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices are gone: not read again, though what surrounds them was.

    A connected patch without readings is gone if new readings lie on all sides of it (in the plane in which
    it extends most), or if nearly all of the surface was read again. Else it was only out of sight.
    """
    is_gone = np.zeros(len(vertices), dtype=bool)
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[faces] = True
    missing = is_used & ~is_read
    if not missing.any():
        return is_gone
    if is_read[is_used].mean() >= _COMPLETE_SHARE:
        return missing
    low, high = compute_extent(new_points)
    margin = (high - low).max() / 2 + spacing
    is_within = np.zeros(len(vertices), dtype=bool)
    is_within[find_inside(vertices, low - margin, high + margin)] = True
    if not (missing & is_within).any():
        return is_gone
    part = number_parts(faces[any_corner(missing & is_within, faces)], missing)
    # A patch that goes on beyond the readings is not surrounded by them.
    is_open = np.bincount(part[missing], ~is_within[missing]) > 0
    is_large = np.bincount(part[missing]) >= _MIN_PATCH
    for number in np.flatnonzero(is_large & ~is_open):
        patch = np.flatnonzero(part == number)
        is_gone[patch] = _is_surrounded(vertices[patch], new_points, spacing)
    return is_gone


def _is_surrounded(
    patch: Float[np.ndarray, "P 3"], readings: Float[np.ndarray, "M 3"], spacing: float
) -> bool:
    """Return whether there are readings just beyond the patch in each sector around it."""
    center = patch.mean(axis=0)
    axes = np.linalg.svd(patch[:_AXIS_SAMPLES] - center, full_matrices=False)[2][:2]
    inside, inside_sector = _to_polar((patch - center) @ axes.T, _NUM_SECTORS)
    around, around_sector = _to_polar((readings - center) @ axes.T, _NUM_SECTORS)
    extent = np.zeros(_NUM_SECTORS)
    np.maximum.at(extent, inside_sector, inside)
    gap = around - extent[around_sector]
    is_beyond = (gap > 0) & (gap < extent.max() + _RIM_WIDTH * spacing)
    return len(np.unique(around_sector[is_beyond])) == _NUM_SECTORS


def _to_polar(
    points: Float[np.ndarray, "N 2"], num_sectors: int
) -> tuple[Float[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return the distance from the origin and the number of the sector."""
    angle = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) % 1.0
    return compute_lengths(points), np.minimum((angle * num_sectors).astype(int), num_sectors - 1)


_POOL_PER_PROBE = 8
"""Old points are thinned to this many for each probe before those near the new readings are selected."""
_POOL_PER_KNOWN = 4
"""Likewise, to this many in the box around what may have moved, before those near it are selected."""


_TOLERANCE = 4.0
"""A reading farther from the surface than this many times the usual distance disagrees. Of normally distributed noise
one reading in 700 does; lower, and noise moves vertices."""
_STRONG_RATIO = 1.5  # A disagreement of more than this many tolerances is strong: no noise reaches so far
_MIN_READINGS = 3  # Readings that must disagree near a vertex, or be strong together; fewer may be outliers
_CROWD_DISTANCE = 3.0  # Readings within this many vertex spacings are near one another
_MOVED_SHARE = 0.3  # A vertex has moved where more than this share of its new readings disagree
_SIGNIFICANCE = 3.0
"""It has not moved where no more disagree than the old readings predict, within this many standard deviations. A
coarse mesh cuts corners, so that some readings always disagree there."""
_CROP_MARGIN = 2.0  # Faces and old points within this many vertex spacings of the new readings are compared
_MIN_COMPARED = 4096  # At least this many of the new readings are compared, where there are as many
_COMPARED_PER_FACE = 3  # Of more readings than this for each face only a part is compared; more are slower
_NUM_PROBES = 1000  # Old points that measure the usual distance to the surface
_MIN_PROBES = 100  # Where fewer old points lie near the new readings, all old points are probed


class Change(NamedTuple):
    """New readings, compared with a surface."""

    compared: Int[np.ndarray, " C"]  # the new readings that were compared: all, or as many as suffice
    winners: Int[np.ndarray, " C"]  # the vertex nearest to each of these
    distance: Float[np.ndarray, " C"]  # distance of each of these from the surface [m]
    tolerance: float  # the distance up to which a reading agrees [m]
    is_moved: Bool[np.ndarray, " V"]  # vertices whose new readings disagree with the surface
    is_strong: Bool[np.ndarray, " V"]  # vertices with several readings that disagree by more than any noise
    # vertices without new readings though what surrounds them was read again, and those that rays go through
    is_gone: Bool[np.ndarray, " V"]
    is_read: Bool[np.ndarray, " V"]  # vertices with a new reading nearby

    @property
    def disagrees(self) -> Bool[np.ndarray, " C"]:
        """Which of the compared readings are farther from the surface than the tolerance."""
        return self.distance > self.tolerance


def detect_changes(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    old_points: Float[np.ndarray, "N 3"],
    new_points: Float[np.ndarray, "M 3"],
    spacing: float,
    origins: Float[np.ndarray, "M 3"] | None = None,
    free_rays: Float[np.ndarray, "K 2 3"] | None = None,
) -> Change:
    """Compare new readings with a surface."""
    import igl

    vertices, faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)
    margin = _CROP_MARGIN * spacing
    about, probes = _crop(vertices, faces, old_points, new_points, margin)
    compared = thin(np.arange(len(new_points)), max(_MIN_COMPARED, _COMPARED_PER_FACE * len(about)))
    readings = new_points[compared]
    surface = igl.AABB()
    surface.init(vertices, about)
    squared, nearest, closest = (
        np.asarray(part)
        for part in surface.squared_distance(vertices, about, np.concatenate([readings, probes]))
    )
    distance = np.sqrt(np.maximum(squared, 0))
    number = len(readings)
    tolerance = _TOLERANCE * float(np.mean(distance[number:]))
    distance, nearest_faces = distance[:number], about[nearest[:number]]
    winners = _find_corners(vertices, nearest_faces, readings)
    # Readings just beyond the boundary of a surface do not contradict it.
    height = _compute_heights(vertices, nearest_faces, readings, closest[:number])
    disagrees = (height > tolerance) | (distance > spacing)
    is_moved = _find_moved(winners, readings, disagrees, spacing, len(vertices))
    known = _pick_known(vertices[is_moved], old_points, spacing)
    if len(known):
        _, nearest, closest = (np.asarray(part) for part in surface.squared_distance(vertices, about, known))
        nearest_faces = about[nearest]
        has_disagreed = _compute_heights(vertices, nearest_faces, known, closest) > tolerance
        owners = _find_corners(vertices, nearest_faces, known)
        is_moved &= _is_significant(winners, disagrees, owners, has_disagreed, len(vertices), _SIGNIFICANCE)
    is_strong = _find_strong(winners, readings, distance, tolerance, spacing, len(vertices))
    is_read = find_read(vertices, new_points, spacing)
    is_gone = find_gone(vertices, faces, new_points, is_read | is_moved, spacing)
    if origins is not None or free_rays is not None:
        agreeing = np.bincount(winners[distance <= tolerance], minlength=len(vertices))
        reach = FACE_REACH * spacing
        free = np.empty((0, 2, 3)) if free_rays is None else free_rays
        begins, ends = free[:, 0], free[:, 1]
        if origins is not None:
            begins, ends = np.concatenate([origins[compared], begins]), np.concatenate([readings, ends])
        is_gone |= find_crossed_vertices(vertices, faces, ends, begins, agreeing, tolerance, reach)
    return Change(compared, winners, distance, tolerance, is_moved, is_strong, is_gone, is_read)


def find_crowded(
    winners: Int[np.ndarray, " N"], points: Float[np.ndarray, "N 3"], distance: float, min_readings: int
) -> Bool[np.ndarray, " N"]:
    """Return which readings are not alone: won by the vertex of enough others, or near to enough others."""
    if len(points) < min_readings:
        return np.zeros(len(points), dtype=bool)
    is_crowded = np.bincount(winners)[winners] >= min_readings
    left = np.flatnonzero(~is_crowded)
    if len(left):
        tree = cKDTree(points, balanced_tree=False)
        crowd, _ = tree.query(points[left], k=[min_readings], distance_upper_bound=distance)
        is_crowded[left] = np.isfinite(crowd[:, -1])
    return is_crowded


def _crop(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    old_points: Float[np.ndarray, "N 3"],
    new_points: Float[np.ndarray, "M 3"],
    margin: float,
) -> tuple[Int[np.ndarray, "A 3"], Float[np.ndarray, "P 3"]]:
    """Return the faces that are near new readings, and old points to compare with."""
    low, high = compute_extent(new_points)
    low, high = low - margin, high + margin
    is_inside = np.zeros(len(vertices), dtype=bool)
    is_inside[find_inside(vertices, low, high)] = True
    probes = old_points[:: max(1, len(old_points) // (_POOL_PER_PROBE * _NUM_PROBES))]
    inner = find_inside(probes, low + margin / 2, high - margin / 2)
    about = faces[any_corner(is_inside, faces)]
    if len(inner) < _MIN_PROBES or len(about) == 0:
        return faces, thin(probes, _NUM_PROBES)
    return np.ascontiguousarray(about), thin(probes[inner], _NUM_PROBES)


def _compute_heights(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "M 3"],
    points: Float[np.ndarray, "M 3"],
    closest: Float[np.ndarray, "M 3"],
) -> Float[np.ndarray, " M"]:
    """Return how far the points are from the planes of their nearest faces [m]."""
    return np.abs(np.einsum("mk,mk->m", points - closest, compute_normals(vertices, faces)))


def _find_corners(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "M 3"], points: Float[np.ndarray, "M 3"]
) -> Int[np.ndarray, " M"]:
    """Return the corner of each point's nearest face that is nearest to the point."""
    squared = sum_rows((vertices[faces] - points[:, None]) ** 2)
    return faces[np.arange(len(faces)), squared.argmin(axis=1)]


def _find_moved(
    winners: Int[np.ndarray, " C"],
    readings: Float[np.ndarray, "C 3"],
    disagrees: Bool[np.ndarray, " C"],
    spacing: float,
    num_vertices: int,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices win mostly readings that disagree, enough of them within their neighborhood."""
    against = np.flatnonzero(disagrees)
    is_crowded = find_crowded(winners[against], readings[against], _CROWD_DISTANCE * spacing, _MIN_READINGS)
    contradictions = np.bincount(winners[against[is_crowded]], minlength=num_vertices)
    return contradictions > _MOVED_SHARE * np.bincount(winners, minlength=num_vertices)


def _find_strong(
    winners: Int[np.ndarray, " C"],
    readings: Float[np.ndarray, "C 3"],
    distance: Float[np.ndarray, " C"],
    tolerance: float,
    spacing: float,
    num_vertices: int,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices win several readings farther from the surface than any noise."""
    far = np.flatnonzero(distance > _STRONG_RATIO * tolerance)
    crowded = far[find_crowded(winners[far], readings[far], _CROWD_DISTANCE * spacing, _MIN_READINGS)]
    is_strong = np.zeros(num_vertices, dtype=bool)
    is_strong[winners[crowded]] = True
    return is_strong


def _pick_known(
    vertices: Float[np.ndarray, "A 3"], points: Float[np.ndarray, "N 3"], spacing: float
) -> Float[np.ndarray, "P 3"]:
    """Return old points nearer to one of the vertices than the spacing, as many as suffice."""
    if len(vertices) == 0:
        return points[:0]
    inside = points[thin(find_near_box(points, vertices, spacing), _POOL_PER_KNOWN * _NUM_PROBES)]
    distance, _ = cKDTree(vertices).query(inside, distance_upper_bound=spacing)
    return inside[thin(np.flatnonzero(np.isfinite(distance)), _NUM_PROBES)]


def _is_significant(
    winners: Int[np.ndarray, " C"],
    disagrees: Bool[np.ndarray, " C"],
    owners: Int[np.ndarray, " P"],
    has_disagreed: Bool[np.ndarray, " P"],
    num_vertices: int,
    significance: float,
) -> Bool[np.ndarray, " V"]:
    """Return at which vertices clearly more of the new readings disagree than did of the old."""
    before, now = (np.bincount(to, minlength=num_vertices).astype(np.float64) for to in (owners, winners))
    were_against, are_against = (
        np.bincount(to, weights, minlength=num_vertices)
        for to, weights in ((owners, has_disagreed), (winners, disagrees))
    )
    expected = were_against / np.maximum(before, 1) * now
    share = (were_against + 0.5) / (
        before + 1
    )  # with half a count more of each kind, so that no share is certain
    # Both counts scatter: the expected one is known no better than the old readings show.
    variance = share * (1 - share) * now * (1 + now / np.maximum(before, 1)) * (before > 0)
    return are_against - expected > significance * np.sqrt(variance + 0.25)  # a count is rounded by up to 1/2
