"""Topology learning: from the winners of all samples to edges, faces and a two-manifold.

Every sample is a witness that its nearest units are neighbors (competitive Hebbian learning, extended to the
third winner). Three units that are neighbors of one another are a face if the ball around them contains no other
neighbor, as in a Delaunay triangulation restricted to the surface.

References:
    Martinetz and Schulten (1994), Topology representing networks.
    Rêgo, Araújo and Lima Neto (2010), Growing self-reconstruction maps: edges and faces from the two winners.
    Differs: the third winner takes part, and all samples are witnesses at once.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import (
    find_border_vertices,
    group_sides,
    is_in_sorted,
    make_manifold,
)
from reconstruction._src.geometry.orientation import compute_components
from reconstruction._src.geometry.rows import Faces, compute_lengths, sum_rows
from reconstruction._src.networks.gsrm.hole_patching import close_tips, patch_holes
from reconstruction._src.networks.gsrm.support import MAX_VOID, NUM_NEIGHBORS, Support, Units, find_sparse

Keys = Int[np.ndarray, " K"]  # Triples of units, each as one number

_RIM_NEIGHBORS = 24  # Likewise `NUM_NEIGHBORS`, at the boundary (the rim) of a component, between components
_MIN_COMPONENT = 6  # Components of fewer faces are debris, where another is `_DEBRIS_RATIO` times as large
_DEBRIS_RATIO = 50  # See `_MIN_COMPONENT`
_MAX_REPAIRS = 6
"""Rounds in which faces around a hole that cannot be closed are removed to close a larger one."""
_EMPTINESS_SLACK = 1e-5  # Share of the squared radius by which float32 may misplace a neighbor on the ball
_FLATNESS = 1e-10
"""A face whose squared area is a smaller share of its squared sides has no circumscribed circle in float64."""


def learn_faces(
    units: Units,
    winners: Int[np.ndarray, "N 3"],
    support: Support,
    known: Int[np.ndarray, "K 3"] | None = None,
) -> Faces:
    """Return the faces of an oriented two-manifold between the units."""
    units = np.asarray(units, dtype=np.float64)
    faces, margin = _propose_faces(units, winners, support)
    if known is not None:
        is_new = ~_lies_on_full(faces, known, len(units))
        is_new &= ~np.isin(_key(faces.astype(np.int64), len(units)), _key(known.astype(np.int64), len(units)))
        margin = np.concatenate([np.full(len(known), np.inf), margin[is_new]])
        faces = np.concatenate([known, faces[is_new]])
    faces = _finish_faces(units, faces, margin, support)
    return join_components(units, faces, support) if support.is_uneven and len(faces) else faces


def _propose_faces(
    units: Units, winners: Int[np.ndarray, "N 3"], support: Support
) -> tuple[Faces, Float[np.ndarray, " F"]]:
    """Return the faces that the samples witness, no manifold yet, and how empty their balls are."""
    triples = find_triples(winners, len(units))
    sparse = find_sparse(winners[:, 0], len(units))
    if len(sparse):
        triples = _witness_midpoints(units, triples, sparse, support, NUM_NEIGHBORS)
    faces, margin = _propose(units, triples, support)
    if support.is_uneven:
        # Between scan lines farther apart than the units on them no sample sees both sides.
        border = _find_border(faces, len(units))
        triples = _witness_midpoints(units, triples, border, support, NUM_NEIGHBORS)
        faces, margin = _propose(units, triples, support)
    return faces, margin


def join_components(units: Units, faces: Faces, support: Support) -> Int[np.ndarray, "G 3"]:
    """Return the faces and those that close gaps between their components, where samples lie in these.

    Where scan lines are far apart, the units at a boundary are not the nearest to one another. Faces between two
    boundaries of one component are left out: they make handles.
    """
    num_units = len(units)
    part = np.arange(num_units)
    part[faces] = num_units + compute_components(faces, num_units)[:, None]
    if part.max() == num_units:
        return faces
    border = _find_border(faces, num_units)
    known = _sorted_unique(_key(faces[np.isin(faces, border).any(axis=1)].astype(np.int64), num_units))
    triples = _witness_midpoints(units, known, border, support, _RIM_NEIGHBORS)
    proposed, margin = _propose(units, triples, support)
    is_new = np.ptp(part[proposed], axis=1) > 0
    is_new &= ~_lies_on_full(proposed, faces, num_units)
    is_new[is_new] = support.measure_void(units[proposed[is_new]]) <= MAX_VOID
    if not is_new.any():
        return faces
    quality = np.concatenate([np.full(len(faces), np.inf), margin[is_new]])
    return _finish_faces(units, np.concatenate([faces, proposed[is_new]]), quality, support)


def _lies_on_full(proposed: Int[np.ndarray, "P 3"], faces: Faces, num_units: int) -> Bool[np.ndarray, " P"]:
    """Return which proposed faces have a side that lies between two faces already."""
    sides = group_sides(faces, num_units)
    others = np.roll(proposed, -1, axis=1)
    wanted = np.minimum(proposed, others) * num_units + np.maximum(proposed, others)
    return np.asarray(is_in_sorted(wanted.ravel(), sides.keys[sides.counts == 2]).reshape(-1, 3).any(axis=1))


def _witness_midpoints(
    units: Units, triples: Keys, selected: Int[np.ndarray, " C"], support: Support, num_neighbors: int
) -> Int[np.ndarray, " L"]:
    """Return the keys with those that places between the selected units and their neighbors witness as well."""
    midpoints = _compute_midpoints(units, selected, num_neighbors)
    added = cKDTree(units).query(midpoints[support.is_near(midpoints)], k=3)[1]
    return _sorted_unique(np.concatenate([triples, find_triples(added, len(units))]))


def _propose(units: Units, triples: Keys, support: Support) -> tuple[Faces, Float[np.ndarray, " F"]]:
    """Return the faces of witnessed edges that are empty and lie on samples, and their margins."""
    edges, cliques = find_cliques(triples, len(units))
    empty, margin = find_empty(units, cliques, edges)
    faces = cliques[empty]
    is_doubtful = ~is_in_sorted(_key(faces, len(units)), triples)
    is_kept = ~is_doubtful
    is_kept[is_doubtful] = support.measure_void(units[faces[is_doubtful]]) <= MAX_VOID
    return faces[is_kept], margin[is_kept]


def _find_border(faces: Faces, num_units: int) -> Int[np.ndarray, " B"]:
    """Return the units at the end of an edge with one face, and those without a face."""
    is_bare = np.bincount(faces.ravel(), minlength=num_units) == 0
    return np.flatnonzero(is_bare | find_border_vertices(faces, num_units))


def _finish_faces(
    units: Units, faces: Faces, quality: Float[np.ndarray, " F"], support: Support
) -> Int[np.ndarray, "G 3"]:
    """Return an oriented two-manifold: of conflicting faces the better stay, holes are patched."""
    faces = make_manifold(units, faces, quality)
    for _ in range(_MAX_REPAIRS):
        faces, obstacles = patch_holes(units, faces, support)
        if len(obstacles) == 0:
            break
        faces = np.delete(faces, obstacles, axis=0)
        corners = units[faces]
        perimeter = compute_lengths(corners - np.roll(corners, 1, axis=1)).sum(axis=1)
        faces = make_manifold(units, faces, 1 / np.maximum(perimeter, 1e-300))
    faces = close_tips(units, faces, support)
    if len(faces) < _DEBRIS_RATIO:
        return faces
    part = compute_components(faces, len(units))
    sizes = np.bincount(part)
    return faces[((sizes >= _MIN_COMPONENT) | (sizes * _DEBRIS_RATIO > sizes.max()))[part]]


def _compute_midpoints(
    units: Units, selected: Int[np.ndarray, " C"], num_neighbors: int
) -> Float[np.ndarray, "P 3"]:
    """Return the places halfway between each selected unit and its nearest ones."""
    num_neighbors = min(num_neighbors, len(units) - 1)
    _, neighbors = cKDTree(units).query(units[selected], k=num_neighbors + 1)
    pairs = np.stack(np.broadcast_arrays(selected[:, None], neighbors[:, 1:]), axis=-1).reshape(-1, 2)
    keys = _sorted_unique(pairs.min(axis=1) * len(units) + pairs.max(axis=1))
    return (units[keys // len(units)] + units[keys % len(units)]) / 2


def find_triples(winners: Int[np.ndarray, "N 3"], num_units: int) -> Keys:
    """Return the keys of the witnessed triples, ascending: what three units win together."""
    return _sorted_unique(_key(winners.astype(np.int64), num_units))


def find_cliques(triples: Keys, num_units: int) -> tuple[Int[np.ndarray, "E 2"], Faces]:
    """Return the witnessed edges and all triangles of them, both in ascending order."""
    c = triples % num_units
    a, b = np.divmod(triples // num_units, num_units)
    keys = _sorted_unique(np.concatenate([a * num_units + b, a * num_units + c, b * num_units + c]))
    edges = np.stack(np.divmod(keys, num_units), axis=1)
    start = np.searchsorted(edges[:, 0], np.arange(num_units + 1))
    # Edge (i, j) with every later edge (i, k): is (j, k) an edge as well?
    place = np.arange(len(edges))
    num_later = start[edges[:, 0] + 1] - place - 1
    first = np.repeat(place, num_later)
    later = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(num_later) - num_later, num_later)
    wanted = edges[first, 1] * num_units + edges[later, 1]
    found = is_in_sorted(wanted, keys)
    first, later = first[found], later[found]
    return edges, np.stack([edges[first, 0], edges[first, 1], edges[later, 1]], axis=1)


def find_empty(
    units: Units, faces: Faces, edges: Int[np.ndarray, "E 2"]
) -> tuple[Int[np.ndarray, " G"], Float[np.ndarray, " G"]]:
    """Find the faces whose circumscribed ball contains no neighbor of a corner."""
    table = _tabulate_neighbors(edges, len(units))
    neighbors = units[table].astype(np.float32)
    centers, squared_radii = compute_circumcenters(units[faces])
    limits = (squared_radii * (1 - _EMPTINESS_SLACK)).astype(np.float32)
    centers = centers.astype(np.float32)
    left, margin = np.flatnonzero(np.isfinite(limits)), np.full(len(faces), np.inf, dtype=np.float32)
    for corner in range(3):
        offset = neighbors[faces[left, corner]] - centers[left, None]
        squared = np.einsum("fnk,fnk->fn", offset, offset)
        around = table[faces[left, corner]]
        for own in range(3):
            squared[around == faces[left, own, None]] = np.inf
        margin[left] = np.minimum(margin[left], squared.min(axis=1))
        left = left[margin[left] >= limits[left]]
    return left, margin[left] / limits[left]


def compute_circumcenters(
    corners: Float[np.ndarray, "F 3 3"],
) -> tuple[Float[np.ndarray, "F 3"], Float[np.ndarray, " F"]]:
    """Return centers and squared radii of the circles through three corners each.

    The radius of a face without area is infinite.
    """
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d00, d01, d11 = sum_rows(side * side), sum_rows(side * other), sum_rows(other * other)
    determinant = 2 * (d00 * d11 - d01 * d01)
    is_flat = determinant <= _FLATNESS * d00 * d11
    determinant = np.where(is_flat, 1, determinant)
    along_side, along_other = d11 * (d00 - d01) / determinant, d00 * (d11 - d01) / determinant
    offset = along_side[:, None] * side + along_other[:, None] * other
    return corners[:, 0] + offset, np.where(is_flat, np.inf, sum_rows(offset * offset))


def _tabulate_neighbors(edges: Int[np.ndarray, "E 2"], num_units: int) -> Int[np.ndarray, "U D"]:
    """Return the neighbors of every unit, filled up with the unit itself."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    degree = np.bincount(ends[:, 0], minlength=num_units)
    table = np.repeat(np.arange(num_units)[:, None], max(degree.max(initial=1), 1), axis=1)
    slot = np.arange(len(ends)) - np.repeat(np.cumsum(degree) - degree, degree)
    table[ends[:, 0], slot] = ends[:, 1]
    return table


def _key(triples: Int[np.ndarray, "N 3"], num_units: int) -> Int[np.ndarray, " N"]:
    """Return one number for every three units, whatever their order."""
    a, b, c = triples.T
    low, high = np.minimum(a, b), np.maximum(a, b)
    middle = np.maximum(low, np.minimum(high, c))
    return (np.minimum(low, c) * num_units + middle) * num_units + np.maximum(high, c)


def _sorted_unique(keys: Int[np.ndarray, " N"]) -> Keys:
    keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) != 0]
