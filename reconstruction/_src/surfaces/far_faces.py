"""Faces far from every reading: a network bridges the shadows of a scan, and nothing tells that there is a surface.

A place is far where its distance from the nearest reading is many times the spacing of the readings there. Three cases
differ: where the surface goes on in the plane of the readings around, as a sparse floor does, it may go farther; where
the scanner looked through it, it is wrong, and need not be as far; anything between stands for what nobody saw.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import compute_normals
from reconstruction._src.geometry.neighbors import query_tree
from reconstruction._src.geometry.orientation import split_fans
from reconstruction._src.geometry.rows import (
    Faces,
    Points,
    Vertices,
    compute_areas,
    compute_lengths,
    drop_unused,
)
from reconstruction._src.geometry.sampling import choose_viewpoints

_NEIGHBORS = 16
"""The spacing at a reading is its distance from this neighbor: nearer ones are all of one scan line."""
_REACH = 2.0  # A place is far at this many spacings from the nearest reading
_PLANE_REACH = 4.0  # ... or this many where the surface goes on in the plane of the readings around.
_SEEN_REACH = 1.0  # ... or this many where the scanner looked through it.
_SLOPE = 0.1  # The surface goes on in a plane where it leaves it by no more than this share of the distance
_AROUND = 8  # So many readings around tell the plane, and so many beams whether the scanner looked through
_MARGIN = 0.1  # Beams that end farther than the place by more than this share of its range looked through it
_SHARE = 0.5  # A face is far where this share of its samples is
_POOL = 256  # Of few places, so many readings around each tell how far it is; of many, all of them
_PROBES = 500  # Places whose spacings give the least spacing of the cloud: their median
_MOST_VIEWPOINTS = 16  # Beams from these viewpoints are looked at: those with most readings


_CORNERS = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Samples of a face: its middle, and half the way from there to each corner."""


def select_faces(
    vertices: Vertices, faces: Faces, is_chosen: Callable[[Points], Bool[np.ndarray, " N"]]
) -> Bool[np.ndarray, " F"]:
    """Return the faces of which half or more of four samples are chosen."""
    samples = np.einsum("sc,fci->fsi", _CORNERS, vertices[faces])
    return is_chosen(samples.reshape(-1, 3)).reshape(-1, len(_CORNERS)).mean(axis=1) >= _SHARE


class CutMesh(NamedTuple):
    """A mesh without the faces that were far from every reading."""

    vertices: Vertices  # those with a face [m]
    faces: Faces  # in their old order
    num_faces: int = 0  # so many were cut off ...
    area: float = 0.0  # ... with this area [m²] ...
    share: float = 0.0  # ... and this share of all area


def cut_far_faces(
    vertices: Vertices,
    faces: Faces,
    points: Points,
    viewpoints: Float[np.ndarray, "K 3"] | None = None,
    seen_from: Int[np.ndarray, " N"] | None = None,
) -> CutMesh:
    """Return a mesh without its far faces; as it is where there are none, or nothing else."""
    is_far = find_far_faces(vertices, faces, points, viewpoints, seen_from)
    if not is_far.any() or is_far.all():
        return CutMesh(vertices, faces)
    areas = compute_areas(vertices, faces)
    area = float(areas[is_far].sum())
    rest = split_fans(*drop_unused(vertices, faces[~is_far]))
    return CutMesh(rest.vertices, rest.faces, int(is_far.sum()), area, area / float(areas.sum()))


def find_far_faces(
    vertices: Vertices,
    faces: Faces,
    points: Points,
    viewpoints: Float[np.ndarray, "K 3"] | None = None,
    seen_from: Int[np.ndarray, " N"] | None = None,
) -> Bool[np.ndarray, " F"]:
    """Return which faces lie far from every reading.

    Readings count where they lie on the surface, so that coarse faces beside dense readings are near them.
    """
    import igl

    is_far = np.zeros(len(faces), dtype=bool)
    if len(faces) == 0 or len(points) <= _NEIGHBORS:
        return is_far
    tree = cKDTree(points, leafsize=16, balanced_tree=False)  # built in two thirds of the time
    samples = np.einsum("sc,fci->fsi", _CORNERS, vertices[faces])
    probes = samples[:: max(1, len(samples) // _PROBES), 0]
    least = float(np.median(_measure_spacing(tree, tree.query(probes)[1], _NEIGHBORS)))
    limit = _SEEN_REACH * least
    bound = np.nextafter(limit, np.inf)
    is_open = np.isinf(query_tree(tree, samples, distance_upper_bound=bound)[0])
    if not is_open.any():
        return is_far
    rows, columns = np.nonzero(is_open)
    around = points
    if _POOL * len(rows) < len(points):
        around = points[np.unique(tree.query(samples[rows, columns], k=_POOL)[1])]
    arrays = (np.ascontiguousarray(array) for array in (around, vertices, faces.astype(np.int64)))
    found = igl.point_mesh_squared_distance(*arrays)
    owner, places = np.asarray(found[1], dtype=np.int64), np.asarray(found[2])
    distance, nearest = cKDTree(places).query(samples[rows, columns])
    spacing = np.maximum(_measure_spacing(tree, nearest, _NEIGHBORS), least)
    ratio = distance / np.maximum(spacing, np.finfo(float).tiny)
    rows, columns, ratio, spacing = (part[ratio > _SEEN_REACH] for part in (rows, columns, ratio, spacing))
    if not len(rows):
        return is_far
    tried, reach = samples[rows, columns], np.full(len(rows), _REACH)
    is_known = ~np.isin(owner, rows)
    if is_known.sum() >= _AROUND:
        normals = compute_normals(vertices, faces)[owner[is_known]]
        reach[_goes_on(tried, places[is_known], normals)] = _PLANE_REACH
    if viewpoints is not None:
        reach[_is_seen_through(tried, spacing, points, viewpoints, seen_from)] = _SEEN_REACH
    return np.bincount(rows[ratio > reach], minlength=len(faces)) >= _SHARE * len(_CORNERS)


def _measure_spacing(tree: cKDTree, rows: Int[np.ndarray, " M"], neighbors: int) -> Float[np.ndarray, " M"]:
    """Return the distance of some readings from their neighbor of that number [m]."""
    unique, place = np.unique(rows, return_inverse=True)
    return tree.query(tree.data[unique], k=[neighbors + 1])[0][:, 0][place.ravel()]


def _goes_on(samples: Float[np.ndarray, "S 3"], places: Points, normals: Points) -> Bool[np.ndarray, " S"]:
    """Return which samples lie in the planes of the surface at most of the places around."""
    distance, nearest = cKDTree(places).query(samples, k=list(range(1, _AROUND + 1)))
    offset = samples[:, None] - places[nearest]
    height = np.abs(np.einsum("ski,ski->sk", offset, normals[nearest]))
    return (height <= _SLOPE * distance).mean(axis=1) > 0.5


def _is_seen_through(
    samples: Float[np.ndarray, "S 3"],
    spacing: Float[np.ndarray, " S"],
    points: Points,
    viewpoints: Float[np.ndarray, "K 3"],
    seen_from: Int[np.ndarray, " N"] | None,
) -> Bool[np.ndarray, " S"]:
    """Return which samples have beams all around that end farther away."""
    seen_from = choose_viewpoints(points, viewpoints) if seen_from is None else seen_from
    found = np.zeros(len(samples), dtype=bool)
    counts = np.bincount(seen_from, minlength=len(viewpoints))
    for row in np.argsort(-counts, kind="stable")[:_MOST_VIEWPOINTS]:
        if counts[row] <= _AROUND:
            break
        beams = points[seen_from == row] - viewpoints[row]
        ranges = compute_lengths(beams)
        tree = cKDTree(beams / np.maximum(ranges, np.finfo(float).tiny)[:, None])
        ways = samples - viewpoints[row]
        lengths = np.maximum(compute_lengths(ways), np.finfo(float).tiny)
        angle, nearest = tree.query(ways / lengths[:, None], k=list(range(1, _AROUND + 1)))
        is_among = angle[:, 0] <= _measure_spacing(tree, nearest[:, 0], _AROUND)
        is_farther = (ranges[nearest] > ((1 + _MARGIN) * lengths + spacing)[:, None]).all(axis=1)
        found |= is_among & is_farther
    return found
