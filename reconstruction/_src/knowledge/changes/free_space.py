"""The free-space (visibility) check: what rays go through is no longer there."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Num
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reconstruction._src.geometry.rows import any_corner, compute_lengths, cross_rows, find_near_box, sum_rows


def widen(
    faces: Int[np.ndarray, "F 3"], is_marked: Bool[np.ndarray, " V"], rings: int
) -> Bool[np.ndarray, " V"]:
    """Return the marked vertices and `rings` rings of neighbors."""
    is_marked = is_marked.copy()
    for _ in range(rings):
        is_marked[faces[any_corner(is_marked, faces)]] = True
    return is_marked


def number_parts(faces: Int[np.ndarray, "F 3"], is_marked: Bool[np.ndarray, " V"]) -> Int[np.ndarray, " V"]:
    """Return for every marked vertex the number of its connected part, for the others -1."""
    number = np.full(len(is_marked), -1)
    marked = np.flatnonzero(is_marked)
    number[marked] = np.arange(len(marked))
    corners = number[faces[is_marked[faces].sum(axis=1) >= 2]]
    pairs = np.concatenate([corners[:, :2], corners[:, 1:], corners[:, ::2]])
    pairs = pairs[(pairs >= 0).all(axis=1)]
    graph = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(marked), len(marked)))
    number[marked] = connected_components(graph, directed=False)[1]
    return number


_MIN_RAYS = 3  # Rays that must go through a vertex's faces before it is gone; fewer may be outliers
_CROSSING_SHARE = 0.3
"""A vertex is gone where the rays that go through are more than this share of them and the readings that agree with
it. Higher, and half-transparent objects stay."""
_MAX_RAYS = 4096
"""Largest number of rays that are all followed; of more, every n-th is. Fewer are faster and miss small objects."""
_MAX_HITS = 8  # Faces that are tested along each ray
_RESTART = 0.01
"""Behind a hit a ray starts again, this many margins on, so that it does not meet the face again."""
_NUM_STRETCHES = 6
"""Stretches into which the rays are cut; only faces in the bounding box of one are tested. More leave out more faces,
and cost more boxes."""
FACE_REACH = 2.0  # Faces whose corners all lie farther than this many vertex spacings from all rays meet none


def find_crossed_vertices(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    points: Float[np.ndarray, "M 3"],
    origins: Float[np.ndarray, "M 3"],
    agreeing: Num[np.ndarray, " V"],
    margin: float,
    reach: float,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices lie in free space: rays go through their faces.

    A ray goes through a face where it continues by more than the margin behind it, measured along the face's
    normal, and neither ends nor meets another face on that way: it does not only graze an edge.
    """
    followed = max(1, -(-len(points) // _MAX_RAYS))
    points, origins = points[::followed], origins[::followed]
    faces = _find_reachable_faces(vertices, faces, points, origins, reach, _NUM_STRETCHES)
    if len(faces) == 0:
        return np.zeros(len(vertices), dtype=bool)
    hits = _find_hits(vertices, faces, points, origins, margin)
    crosses = _find_crossings(hits, vertices, faces, points - origins, margin)
    votes = np.bincount(faces[hits.face, hits.corner][crosses], minlength=len(vertices))
    is_crossed = (votes >= _MIN_RAYS) & (votes > _CROSSING_SHARE * (votes + agreeing / followed))
    is_open = (votes > 0) & (agreeing == 0)
    while True:
        wider = is_crossed | widen(faces, is_crossed, 1) & is_open
        if (wider == is_crossed).all():
            return is_crossed
        is_crossed = wider


class _Hits(NamedTuple):
    """Where rays meet faces, ray by ray and along each ray."""

    ray: Int[np.ndarray, " H"]  # index of the ray
    face: Int[np.ndarray, " H"]  # index of the face
    share: Float[np.ndarray, " H"]  # fraction of the way from the ray's origin to its end
    corner: Int[np.ndarray, " H"]  # corner of the face, 0 to 2, the one nearest to the hit


def _find_crossings(
    hits: _Hits,
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    directions: Float[np.ndarray, "R 3"],
    margin: float,
) -> Bool[np.ndarray, " H"]:
    """Return at which hits the ray continues behind the face, and came to it, by more than the margin."""
    direction = directions[hits.ray]
    a, b, c = vertices[faces[hits.face]].swapaxes(0, 1)
    normal = cross_rows(b - a, c - a)
    normal /= np.maximum(compute_lengths(normal)[..., None], 1e-300)
    steepness = np.abs(sum_rows(normal * direction))
    # The hits of one ray follow one another; the last is followed by the ray's end.
    is_last = np.append(hits.ray[1:] != hits.ray[:-1], True) if len(hits.ray) else np.zeros(0, dtype=bool)
    onward = np.where(is_last, 1.0, np.append(hits.share[1:], 1.0)) - hits.share
    back = np.where(np.append(True, is_last[:-1]), np.inf, hits.share - np.append(0.0, hits.share[:-1]))
    return np.minimum(onward, back) * steepness > margin


def _find_reachable_faces(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    points: Float[np.ndarray, "R 3"],
    origins: Float[np.ndarray, "R 3"],
    reach: float,
    num_stretches: int,
) -> Int[np.ndarray, "G 3"]:
    """Return the faces that rays may meet before their ends."""
    is_about = np.zeros(len(vertices), dtype=bool)
    first, last = np.ascontiguousarray(origins.T), np.ascontiguousarray(points.T)
    ends = [first + share * (last - first) for share in np.linspace(0, 1, num_stretches + 1)]
    low, high = (np.array([pick(end, axis=1) for end in ends]) for pick in (np.min, np.max))
    for stretch in range(num_stretches):
        box = np.concatenate([low[stretch : stretch + 2], high[stretch : stretch + 2]])
        is_about[find_near_box(vertices, box, reach)] = True
    return np.ascontiguousarray(faces[any_corner(is_about, faces)])


def _find_hits(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
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
    found: list[tuple[np.ndarray, ...]] = []
    for _ in range(_MAX_HITS):
        way, left = direction[ray], stop[ray] - start
        at, share, _ = (
            np.asarray(part)
            for part in surface.intersect_ray_first(
                vertices, faces, origins[ray] + start[:, None] * way, left[:, None] * way, 1.0
            )
        )
        share = start + left * share
        is_hit = (at >= 0) & (left > 0) & (share < stop[ray])
        ray, face, share = ray[is_hit], at[is_hit], share[is_hit]
        if len(ray) == 0:
            break
        place = origins[ray] + share[:, None] * direction[ray]
        found.append((ray, face, share, ((vertices[faces[face]] - place[:, None]) ** 2).sum(2).argmin(1)))
        start = share + _RESTART * margin / length[ray]
    if not found:
        nothing = np.empty(0, dtype=np.int64)
        return _Hits(nothing, nothing, np.empty(0), nothing)
    ray, face, share, corner = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((share, ray))
    return _Hits(ray[order], face[order], share[order], corner[order])
