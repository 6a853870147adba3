"""Topology learning: from the winners of all samples to edges, faces and a two-manifold.

Every sample is a witness that its nearest units are neighbours (competitive Hebbian learning, extended to the
third winner). Three units that are neighbours of one another are a face if the ball round them holds no other
neighbour, as in a Delaunay triangulation restricted to the surface.

References:
    Martinetz and Schulten (1994), Topology representing networks.
    Rêgo, Araújo and Lima Neto (2010), Growing self-reconstruction maps: edges and faces from the two winners.
    Differs: the third winner takes part, and all samples are witnesses at once.
"""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.manifold import group_sides, is_in_sorted, make_manifold
from reconstruction.geometry.orientation import find_components
from reconstruction.geometry.rows import find_lengths, sum_rows
from reconstruction.networks.gsrm.hole_patching import close_tips, patch_holes
from reconstruction.networks.gsrm.support import MAX_VOID, NUM_NEIGHBORS, Support, find_sparse

MIN_COMPONENT_FACES = 6
DEBRIS_RATIO = 50
"""Components of fewer faces are debris beside one so many times as large."""
MAX_REPAIRS = 6
"""How often faces round a hole that cannot be closed are taken away to close a larger one."""
RIM_NEIGHBORS = 24
"""So many of the nearest units of one at a rim may be joined to it."""
_EMPTINESS_SLACK = 1e-5


def learn_faces(units: np.ndarray, winners: np.ndarray, support: Support) -> np.ndarray:
    """Return the faces `[F, 3]` of an oriented two-manifold between the units.

    Args:
        units: `[U, 3]`, at least three.
        winners: `[N, 3]` the three units nearest to each sample.
        support: tells whether samples lie on a face; holes elsewhere stay open.
    """
    units = np.asarray(units, dtype=np.float64)
    faces, margin = propose_faces(units, winners, support)
    faces = finish_faces(units, faces, margin, support)
    return join_rims(units, faces, support) if support.is_uneven and len(faces) else faces


def propose_faces(units: np.ndarray, winners: np.ndarray, support: Support) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces that the samples witness, `[F, 3]`, and how empty their balls are, `[F]`.

    Arguments as of `learn_faces`. The faces are not a manifold yet.
    """
    triples = find_triples(winners, len(units))
    sparse = find_sparse(winners[:, 0], len(units))
    if len(sparse):
        triples = _witness_midpoints(units, triples, sparse, support)
    faces, margin = _propose(units, triples, support)
    if support.is_uneven:
        # Between scan lines farther apart than the units on them no sample sees both sides.
        faces, margin = _propose(
            units, _witness_midpoints(units, triples, find_border(faces, len(units)), support), support
        )
    return faces, margin


def join_rims(units: np.ndarray, faces: np.ndarray, support: Support) -> np.ndarray:
    """Return the faces and those that close gaps between their components, where samples lie in these.

    Where scan lines are far apart, the units at a rim are not the nearest to one another. Faces between two
    rims of one component are left out: they make handles.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]` of an oriented two-manifold.
        support: tells whether samples lie on a face.
    """
    num_units = len(units)
    part = np.arange(num_units)
    part[faces] = num_units + find_components(faces, num_units)[:, None]
    if part.max() == num_units:
        return faces
    border = find_border(faces, num_units)
    known = _sorted_unique(_key(faces[np.isin(faces, border).any(axis=1)].astype(np.int64), num_units))
    triples = _witness_midpoints(units, known, border, support, RIM_NEIGHBORS)
    proposed, margin = _propose(units, triples, support)
    is_new = np.ptp(part[proposed], axis=1) > 0
    is_new &= ~_lies_on_full(proposed, faces, num_units)
    is_new[is_new] = support.measure_void(units[proposed[is_new]]) <= MAX_VOID
    if not is_new.any():
        return faces
    quality = np.concatenate([np.full(len(faces), np.inf), margin[is_new]])
    return finish_faces(units, np.concatenate([faces, proposed[is_new]]), quality, support)


def _lies_on_full(proposed: np.ndarray, faces: np.ndarray, num_units: int) -> np.ndarray:
    """Return which proposed faces have a side that lies between two faces already: `[P]`."""
    sides = group_sides(faces, num_units)
    slots = sides.slots[sides.starts[sides.counts == 2]]
    tail, head = faces.ravel()[slots].astype(np.int64), faces[slots // 3, (slots % 3 + 1) % 3]
    full = np.minimum(tail, head) * num_units + np.maximum(tail, head)
    others = np.roll(proposed, -1, axis=1)
    wanted = np.minimum(proposed, others) * num_units + np.maximum(proposed, others)
    return np.asarray(is_in_sorted(wanted.ravel(), full).reshape(-1, 3).any(axis=1))


def _witness_midpoints(
    units: np.ndarray,
    triples: np.ndarray,
    chosen: np.ndarray,
    support: Support,
    num_neighbors: int = NUM_NEIGHBORS,
) -> np.ndarray:
    """Return the keys with those that places between the chosen units and their neighbours witness as well."""
    midpoints = find_midpoints(units, chosen, num_neighbors)
    added = cKDTree(units).query(midpoints[support.is_near(midpoints)], k=3)[1]
    return _sorted_unique(np.concatenate([triples, find_triples(added, len(units))]))


def _propose(units: np.ndarray, triples: np.ndarray, support: Support) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces of witnessed edges that are empty and lie on samples, and their margins."""
    edges, cliques = find_cliques(triples, len(units))
    empty, margin = find_empty(units, cliques, edges)
    faces = cliques[empty]
    is_doubtful = ~is_in_sorted(_key(faces, len(units)), triples)
    is_kept = ~is_doubtful
    is_kept[is_doubtful] = support.measure_void(units[faces[is_doubtful]]) <= MAX_VOID
    return faces[is_kept], margin[is_kept]


def find_border(faces: np.ndarray, num_units: int) -> np.ndarray:
    """Return the units `[B]` at the end of an edge with one face, and those without a face."""
    sides = group_sides(faces, num_units)
    slots = sides.slots[sides.starts[sides.counts == 1]]
    is_border = np.bincount(faces.ravel(), minlength=num_units) == 0
    is_border[faces.ravel()[slots]] = is_border[faces[slots // 3, (slots % 3 + 1) % 3]] = True
    return np.flatnonzero(is_border)


def finish_faces(units: np.ndarray, faces: np.ndarray, quality: np.ndarray, support: Support) -> np.ndarray:
    """Return an oriented two-manifold: of conflicting faces the better stay, holes are patched.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]` proposed ones.
        quality: `[F]` the larger the better.
        support: tells whether samples lie on a patch.
    """
    faces = make_manifold(units, faces, quality)
    for _ in range(MAX_REPAIRS):
        faces, obstacles = patch_holes(units, faces, support)
        if len(obstacles) == 0:
            break
        faces = np.delete(faces, obstacles, axis=0)
        faces = make_manifold(units, faces, rate_faces(units, faces))
    return drop_debris(close_tips(units, faces, support), len(units))


def drop_debris(faces: np.ndarray, num_units: int) -> np.ndarray:
    """Return the faces without components of a few faces, where there are much larger ones."""
    if len(faces) < DEBRIS_RATIO:
        return faces
    part = find_components(faces, num_units)
    sizes = np.bincount(part)
    return faces[(sizes >= MIN_COMPONENT_FACES)[part] | (sizes * DEBRIS_RATIO > sizes.max())[part]]


def find_midpoints(units: np.ndarray, chosen: np.ndarray, num_neighbors: int = NUM_NEIGHBORS) -> np.ndarray:
    """Return the places halfway between each chosen unit and its nearest ones: `[P, 3]`."""
    num_neighbors = min(num_neighbors, len(units) - 1)
    _, neighbors = cKDTree(units).query(units[chosen], k=num_neighbors + 1)
    pairs = np.stack(np.broadcast_arrays(chosen[:, None], neighbors[:, 1:]), axis=-1).reshape(-1, 2)
    keys = _sorted_unique(pairs.min(axis=1) * len(units) + pairs.max(axis=1))
    return (units[keys // len(units)] + units[keys % len(units)]) / 2


def find_triples(winners: np.ndarray, num_units: int) -> np.ndarray:
    """Return the keys `[K]` of the witnessed triples, ascending: what three units win together."""
    return _sorted_unique(_key(winners.astype(np.int64), num_units))


def find_cliques(triples: np.ndarray, num_units: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the witnessed edges `[E, 2]` and all triangles of them `[F, 3]`, both in ascending order."""
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


def find_empty(units: np.ndarray, faces: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the faces whose circumscribed ball holds no neighbour of a corner.

    Returns:
        Which faces, `[E]`, and how empty each ball is, `[E]`: squared distance of the nearest neighbour to
        the centre over the squared radius, at least 1.
    """
    table = _tabulate_neighbors(edges, len(units))
    neighbors = units[table].astype(np.float32)
    centers, squared_radii = find_circumcenters(units[faces])
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


def find_circumcenters(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return centres `[F, 3]` and squared radii `[F]` of the circles through three corners each `[F, 3, 3]`.

    The radius of a face without area is infinite.
    """
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d00, d01, d11 = sum_rows(side * side), sum_rows(side * other), sum_rows(other * other)
    determinant = 2 * (d00 * d11 - d01 * d01)
    is_flat = determinant <= 1e-10 * d00 * d11
    determinant = np.where(is_flat, 1, determinant)
    offset = (d11 * (d00 - d01) / determinant)[:, None] * side + (d00 * (d11 - d01) / determinant)[
        :, None
    ] * other
    return corners[:, 0] + offset, np.where(is_flat, np.inf, sum_rows(offset * offset))


def rate_faces(units: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return how good each face is, `[F]`: short perimeter first, relative to the mean."""
    corners = units[faces]
    perimeter = find_lengths(corners - np.roll(corners, 1, axis=1)).sum(axis=1)
    return perimeter.mean() / np.maximum(perimeter, 1e-300) if len(faces) else perimeter


def _tabulate_neighbors(edges: np.ndarray, num_units: int) -> np.ndarray:
    """Return `[U, D]` the neighbours of every unit, filled up with the unit itself."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    degree = np.bincount(ends[:, 0], minlength=num_units)
    table = np.repeat(np.arange(num_units)[:, None], max(degree.max(initial=1), 1), axis=1)
    slot = np.arange(len(ends)) - np.repeat(np.cumsum(degree) - degree, degree)
    table[ends[:, 0], slot] = ends[:, 1]
    return table


def _key(triples: np.ndarray, num_units: int) -> np.ndarray:
    """Return one number for every three units, whatever their order."""
    a, b, c = triples.T
    low, high = np.minimum(a, b), np.maximum(a, b)
    middle = np.maximum(low, np.minimum(high, c))
    return (np.minimum(low, c) * num_units + middle) * num_units + np.maximum(high, c)


def _sorted_unique(keys: np.ndarray) -> np.ndarray:
    keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) != 0]
