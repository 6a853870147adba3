"""What new readings show about a surface that is known already: agreed, moved, new, or gone.

Both networks refine by this: what the readings contradict is learned again, the rest stays as it is. The free-space
(visibility) check is part of it: what rays go through is no longer there.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Num, Shaped
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import (
    compute_normals,
    compute_vertex_normals,
    find_border_vertices,
    label_parts,
    spread,
    widen,
)
from reconstruction._src.geometry.rows import (
    Faces,
    Points,
    Vertices,
    compute_extent,
    compute_lengths,
    find_inside,
    find_near_box,
    sum_rows,
)

Marks = Bool[np.ndarray, " V"]  # Of each vertex, whether something holds
Readings = Float[np.ndarray, "M 3"]  # Positions [m]

_MIN_RAYS = 3  # Rays that must go through a vertex's faces before it is gone; fewer may be outliers
_CROSSING_SHARE = 0.3
"""A vertex is gone where the rays that go through are more than this share of them and the readings that agree with
it. Higher, and half-transparent objects stay."""
_MAX_RAYS = 4096
"""Largest number of rays that are all followed; of more, every n-th is. Fewer are faster and miss small objects."""
_MAX_HITS = 8  # Faces that are tested along each ray
_RESTART = 0.01
"""Behind a hit a ray starts again, this many margins on, so that it does not meet the face again."""


class _Hits(NamedTuple):
    """Where rays meet faces, ray by ray and along each ray."""

    ray: Int[np.ndarray, " H"]  # index of the ray
    face: Int[np.ndarray, " H"]  # index of the face
    share: Float[np.ndarray, " H"]  # fraction of the way from the ray's origin to its end


def find_crossed_vertices(
    vertices: Vertices,
    faces: Faces,
    points: Readings,
    origins: Readings,
    agreeing: Num[np.ndarray, " V"],
    margin: float,
) -> Marks:
    """Return which vertices lie in free space: rays go through their faces.

    A ray goes through a face where it continues by more than the margin behind it, measured along the face's
    normal, and neither ends nor meets another face on that way: it does not only graze an edge.
    """
    followed = max(1, -(-len(points) // _MAX_RAYS))
    points, origins = points[::followed], origins[::followed]
    hits = _find_hits(vertices, faces, points, origins, margin)
    crossing = _find_crossings(hits, compute_normals(vertices, faces), points - origins, margin)
    ray, corners = hits.ray[crossing], faces[hits.face[crossing]]
    places = origins[ray] + hits.share[crossing, None] * (points - origins)[ray]
    nearest = sum_rows((vertices[corners] - places[:, None]) ** 2).argmin(axis=1)
    votes = np.bincount(corners[np.arange(len(corners)), nearest], minlength=len(vertices))
    is_crossed = (votes >= _MIN_RAYS) & (votes > _CROSSING_SHARE * (votes + agreeing / followed))
    return spread(faces, is_crossed, (votes > 0) & (agreeing == 0))


def _find_hits(
    vertices: Vertices,
    faces: Faces,
    points: Float[np.ndarray, "R 3"],
    origins: Float[np.ndarray, "R 3"],
    margin: float,
) -> _Hits:
    """Return the hits but for those within the margin of a ray's end, which no ray goes through."""
    import igl

    surface = igl.AABB()
    surface.init(vertices, faces)
    direction = points - origins
    length = np.maximum(compute_lengths(direction), 1e-300)
    stop = 1 - margin / length
    ray, start = np.arange(len(points)), np.zeros(len(points))
    found = [(ray[:0], ray[:0], start[:0])]
    for _ in range(_MAX_HITS):
        way, left = direction[ray], stop[ray] - start
        begin = origins[ray] + start[:, None] * way
        hit = surface.intersect_ray_first(vertices, faces, begin, left[:, None] * way, 1.0)
        face, share = np.asarray(hit[0], dtype=np.int64), start + left * np.asarray(hit[1])
        is_hit = (face >= 0) & (left > 0) & (share < stop[ray])
        ray, face, share = ray[is_hit], face[is_hit], share[is_hit]
        if len(ray) == 0:
            break
        found.append((ray, face, share))
        start = share + _RESTART * margin / length[ray]
    ray, face, share = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((share, ray))
    return _Hits(ray[order], face[order], share[order])


def _find_crossings(
    hits: _Hits, normals: Float[np.ndarray, "F 3"], directions: Float[np.ndarray, "R 3"], margin: float
) -> Bool[np.ndarray, " H"]:
    """Return at which hits the ray continues behind the face, and came to it, by more than the margin."""
    if not len(hits.ray):
        return np.zeros(0, dtype=bool)
    steepness = np.abs(sum_rows(normals[hits.face] * directions[hits.ray]))
    # The hits of one ray follow one another; the last is followed by the ray's end.
    is_last = np.append(hits.ray[1:] != hits.ray[:-1], True)
    onward = np.where(is_last, 1.0, np.append(hits.share[1:], 1.0)) - hits.share
    back = np.where(np.append(True, is_last[:-1]), np.inf, hits.share - np.append(0.0, hits.share[:-1]))
    return np.minimum(onward, back) * steepness > margin


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
_MIN_COMPARED = 4096  # At least this many of the new readings are compared, where there are as many
_COMPARED_PER_FACE = 3  # Of more readings than this for each face only a part is compared; more are slower
_NUM_PROBES = 1000  # Old points that measure the usual distance to the surface
_MIN_PROBES = 100  # Where fewer old points lie near the new readings, all old points are probed
_POOL = 8000  # Old points among which those near a place are looked for

_READING_REACH = 1.5
"""A vertex is read where a new reading lies within this many times the usual distance between readings, and one
vertex spacing. Smaller, and vertices between sparse readings seem unread."""
_DENSITY_NEIGHBORS = 5  # Readings in the ball that measures the density, its center included
_NUM_DENSITY_PROBES = 256  # Places at which the density of the new readings is measured
_COMPLETE_SHARE = 0.8
"""New readings on this share of the surface are taken for a whole new scan: what they do not show is gone. Lower, and
a partial scan removes what the scanner could not see."""
_NUM_SECTORS = 12
"""Directions around a patch in which readings must lie just beyond it. More, and small gaps between the readings keep
a patch that is gone."""
_RIM_WIDTH = 6.0  # Readings up to this many vertex spacings beyond the patch's extent lie just beyond it
_MIN_PATCH = 3  # Vertices of the smallest patch that can be gone; fewer miss their readings by chance
_AXIS_SAMPLES = 4096  # As many vertices of a patch determine the plane in which it extends most


class Change(NamedTuple):
    """New readings, compared with a surface."""

    compared: Int[np.ndarray, " C"]  # the new readings that were compared: all, or as many as suffice
    winners: Int[np.ndarray, " C"]  # the vertex nearest to each of these
    distance: Float[np.ndarray, " C"]  # distance of each of these from the surface [m]
    tolerance: float  # the distance up to which a reading agrees [m]
    is_moved: Marks  # vertices whose new readings disagree with the surface
    is_strong: Marks  # vertices with several readings that disagree by more than any noise
    is_gone: Marks  # not read though all around was read again, or passed by rays
    is_read: Marks  # vertices with a new reading nearby

    @property
    def disagrees(self) -> Bool[np.ndarray, " C"]:
        """Which of the compared readings are farther from the surface than the tolerance."""
        return self.distance > self.tolerance


class _Projected(NamedTuple):
    """Points on a surface."""

    distance: Float[np.ndarray, " M"]  # [m]
    height: Float[np.ndarray, " M"]  # over the plane of the nearest face [m]
    winner: Int[np.ndarray, " M"]  # the corner of the nearest face that is nearest


def detect_changes(
    vertices: Vertices,
    faces: Faces,
    old_points: Points,
    new_points: Readings,
    spacing: float,
    origins: Readings | None = None,
    free_rays: Float[np.ndarray, "K 2 3"] | None = None,
) -> Change:
    """Compare new readings with a surface."""
    import igl

    vertices, faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)
    surface, normals, number = igl.AABB(), compute_normals(vertices, faces), len(vertices)
    surface.init(vertices, faces)

    def project(points: np.ndarray) -> _Projected:
        squared, nearest, closest = (
            np.asarray(part) for part in surface.squared_distance(vertices, faces, points)
        )
        height = np.abs(sum_rows((points - closest) * normals[nearest]))
        corner = sum_rows((vertices[faces[nearest]] - points[:, None]) ** 2).argmin(axis=1)
        return _Projected(np.sqrt(np.maximum(squared, 0)), height, faces[nearest, corner])

    compared = thin(np.arange(len(new_points)), max(_MIN_COMPARED, _COMPARED_PER_FACE * len(faces)))
    readings = new_points[compared]
    tolerance = _TOLERANCE * float(np.mean(project(_pick_probes(old_points, new_points, spacing)).distance))
    distance, height, winners = project(readings)
    # Readings just beyond the boundary of a surface do not contradict it.
    disagrees = (height > tolerance) | (distance > spacing)

    def count_crowded(is_selected: np.ndarray) -> np.ndarray:
        rows = np.flatnonzero(is_selected)
        rows = rows[find_crowded(winners[rows], readings[rows], _CROWD_DISTANCE * spacing, _MIN_READINGS)]
        return np.bincount(winners[rows], minlength=number)

    is_moved = count_crowded(disagrees) > _MOVED_SHARE * np.bincount(winners, minlength=number)
    known = _pick_known(vertices[is_moved], old_points, spacing)
    if len(known):
        before = project(known)
        is_moved &= _is_significant(winners, disagrees, before.winner, before.height > tolerance, number)
    is_strong = count_crowded(distance > _STRONG_RATIO * tolerance) > 0
    is_read = find_read(vertices, new_points, spacing)
    is_gone = find_gone(vertices, faces, new_points, is_read | is_moved, spacing)
    if origins is not None or free_rays is not None:
        begins, ends = (np.empty((0, 3)),) * 2 if free_rays is None else free_rays.swapaxes(0, 1)
        if origins is not None:
            begins, ends = np.concatenate([origins[compared], begins]), np.concatenate([readings, ends])
        agreeing = np.bincount(winners[distance <= tolerance], minlength=number)
        is_gone |= find_crossed_vertices(vertices, faces, ends, begins, agreeing, tolerance)
    return Change(compared, winners, distance, tolerance, is_moved, is_strong, is_gone, is_read)


def thin(rows: Shaped[np.ndarray, "N ..."], most: int) -> Shaped[np.ndarray, "M ..."]:
    """Return every n-th of the rows, at most `most` of them."""
    return rows[:: max(1, -(-len(rows) // most))]


def find_crowded(
    winners: Int[np.ndarray, " N"], points: Points, distance: float, min_readings: int
) -> Bool[np.ndarray, " N"]:
    """Return which readings are not alone: won by the vertex of enough others, or near to enough others."""
    if len(points) < min_readings:
        return np.zeros(len(points), dtype=bool)
    near, _ = cKDTree(points).query(points, k=[min_readings], distance_upper_bound=distance)
    return (np.bincount(winners)[winners] >= min_readings) | np.isfinite(near[:, 0])


def find_read(vertices: Vertices, new_points: Readings, spacing: float) -> Marks:
    """Return which vertices have a new reading as near as the density predicts."""
    tree = cKDTree(new_points, balanced_tree=False)
    probes = thin(new_points, _NUM_DENSITY_PROBES)
    usual = float(np.median(tree.query(probes, k=[min(_DENSITY_NEIGHBORS, len(new_points))])[0]))
    reach = _READING_REACH * usual + spacing
    return np.isfinite(tree.query(vertices, distance_upper_bound=reach)[0])


def find_gone(
    vertices: Vertices, faces: Faces, new_points: Readings, is_read: Marks, spacing: float
) -> Marks:
    """Return which vertices are gone: not read again, though what surrounds them was.

    A connected patch without readings is gone if new readings lie on all sides of it (in the plane in which
    it extends most), or if nearly all of the surface was read again. Else it was only out of sight.
    """
    is_gone, is_used, is_within = np.zeros((3, len(vertices)), dtype=bool)
    is_used[faces] = True
    missing = is_used & ~is_read
    if not missing.any() or is_read[is_used].mean() >= _COMPLETE_SHARE:
        return missing
    low, high = compute_extent(new_points)
    margin = (high - low).max() / 2 + spacing
    is_within[find_inside(vertices, low - margin, high + margin)] = True
    part = number_parts(faces, missing)
    # A patch that goes on beyond the readings is not surrounded by them.
    is_open = np.bincount(part[missing], ~is_within[missing]) > 0
    is_large = np.bincount(part[missing]) >= _MIN_PATCH
    for number in np.flatnonzero(is_large & ~is_open):
        patch = part == number
        is_gone[patch] = _is_surrounded(vertices[patch], new_points, spacing)
    return is_gone


def number_parts(faces: Faces, is_marked: Marks) -> Int[np.ndarray, " V"]:
    """Return for every marked vertex the number of its connected part, for the others -1."""
    pairs = np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]])
    pairs = pairs[is_marked[pairs].all(axis=1)]
    label = label_parts(pairs, len(is_marked))
    number = np.full(len(is_marked), -1)
    number[is_marked] = np.unique(label[is_marked], return_inverse=True)[1]
    return number


def _is_surrounded(patch: Float[np.ndarray, "P 3"], readings: Readings, spacing: float) -> bool:
    """Return whether there are readings just beyond the patch in each sector around it."""
    center = patch.mean(axis=0)
    axes = np.linalg.svd(patch[:_AXIS_SAMPLES] - center, full_matrices=False)[2][:2]

    def to_polar(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        flat = (points - center) @ axes.T
        angle = np.arctan2(flat[:, 1], flat[:, 0]) / (2 * np.pi) % 1.0
        sector = np.minimum((angle * _NUM_SECTORS).astype(int), _NUM_SECTORS - 1)
        return compute_lengths(flat), sector

    inside, inside_sector = to_polar(patch)
    around, around_sector = to_polar(readings)
    extent = np.zeros(_NUM_SECTORS)
    np.maximum.at(extent, inside_sector, inside)
    gap = around - extent[around_sector]
    is_beyond = (gap > 0) & (gap < extent.max() + _RIM_WIDTH * spacing)
    return len(np.unique(around_sector[is_beyond])) == _NUM_SECTORS


def _pick_probes(old_points: Points, new_points: Readings, spacing: float) -> Float[np.ndarray, "P 3"]:
    """Return old points near the new readings, or all over the surface, as many as suffice."""
    pool = thin(old_points, _POOL)
    near = find_near_box(pool, new_points, spacing)
    return thin(pool if len(near) < _MIN_PROBES else pool[near], _NUM_PROBES)


def _pick_known(
    vertices: Float[np.ndarray, "A 3"], points: Points, spacing: float
) -> Float[np.ndarray, "P 3"]:
    """Return old points nearer to one of the vertices than the spacing, as many as suffice."""
    if len(vertices) == 0:
        return points[:0]
    inside = thin(points[find_near_box(points, vertices, spacing)], _POOL)
    distance, _ = cKDTree(vertices).query(inside, distance_upper_bound=spacing)
    return thin(inside[np.isfinite(distance)], _NUM_PROBES)


def _is_significant(
    winners: Int[np.ndarray, " C"],
    disagrees: Bool[np.ndarray, " C"],
    owners: Int[np.ndarray, " P"],
    has_disagreed: Bool[np.ndarray, " P"],
    number: int,
) -> Marks:
    """Return at which vertices clearly more of the new readings disagree than did of the old."""
    before, now = (np.bincount(to, minlength=number).astype(np.float64) for to in (owners, winners))
    were_against = np.bincount(owners, has_disagreed, minlength=number)
    are_against = np.bincount(winners, disagrees, minlength=number)
    expected = were_against / np.maximum(before, 1) * now
    share = (were_against + 0.5) / (before + 1)  # half a count more of each kind, so that no share is certain
    # Both counts scatter: the expected one is known no better than the old readings show.
    variance = share * (1 - share) * now * (1 + now / np.maximum(before, 1)) * (before > 0)
    return are_against - expected > _SIGNIFICANCE * np.sqrt(variance + 0.25)  # counts are rounded by 1/2


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
    vertices: Vertices, faces: Faces, change: Change, old_points: Points, new_points: Readings, spacing: float
) -> tuple[Marks, Bool[np.ndarray, " N"]]:
    """Return which vertices have changed, and which old points are still valid.

    Points of vertices that moved or are gone are not valid, unless the surface goes on there; those near them are not
    where new readings lie on another surface. A vertex without valid points has changed, too.
    """
    is_changed = change.is_moved & widen(faces, change.is_strong, _STRONG_RINGS) | _spread_gone(faces, change)
    if not is_changed.any():
        return is_changed, np.ones(len(old_points), dtype=bool)
    is_refuted = is_changed & ~_find_extended(vertices, faces, change, new_points[change.compared])
    is_near, is_valid = widen(faces, is_refuted, _NEAR_RINGS), np.ones(len(old_points), dtype=bool)
    if not is_near.any():
        return is_changed, is_valid
    around = find_near_box(old_points, vertices[is_near], spacing)
    winners = cKDTree(vertices).query(old_points[around])[1]
    lies_on = ~is_refuted[winners]
    doubtful = np.flatnonzero(lies_on & is_near[winners])
    lies_on[doubtful] = _lie_on(old_points[around[doubtful]], new_points, change.tolerance)
    lost, had = (np.bincount(winners[rows], minlength=len(vertices)) for rows in (~lies_on, slice(None)))
    is_valid[around] = lies_on
    return is_changed | (2 * lost > had), is_valid


def _spread_gone(faces: Faces, change: Change) -> Marks:
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
) -> Marks:
    """Return the vertices at the boundary beyond which new readings continue the surface."""
    winner, distant = change.winners[change.disagrees], readings[change.disagrees]
    normals = compute_vertex_normals(vertices, faces)
    normals /= np.maximum(compute_lengths(normals)[..., None], 1e-300)
    offset = distant - vertices[winner]
    rise = np.abs(sum_rows(offset * normals[winner])) / np.maximum(compute_lengths(offset), 1e-300)
    count = np.bincount(winner, minlength=len(vertices))
    flat = np.bincount(winner, rise < _MAX_EXTENSION_RISE, minlength=len(vertices))
    return find_border_vertices(faces, len(vertices)) & (flat > count / 2)


def _lie_on(points: Float[np.ndarray, "P 3"], readings: Readings, tolerance: float) -> Bool[np.ndarray, " P"]:
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
