"""The free-space (visibility) check: what rays go through is no longer there."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Num

from reconstruction._src.geometry.manifold import compute_normals, spread
from reconstruction._src.geometry.rows import Faces, Vertices, compute_lengths, sum_rows

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
    points: Float[np.ndarray, "M 3"],
    origins: Float[np.ndarray, "M 3"],
    agreeing: Num[np.ndarray, " V"],
    margin: float,
) -> Bool[np.ndarray, " V"]:
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
