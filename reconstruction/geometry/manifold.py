"""Faces that share sides: find them, and drop faces until the mesh is an orientable two-manifold."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from reconstruction.geometry.rows import cross_rows, find_lengths, sum_rows

FOLD_COSINE = 0.5
"""Two faces at an edge enclose at least acos of this: 60 degrees."""


class Sides(NamedTuple):
    """The sides of all faces, sorted by the edge they lie on; side k of a face runs from corner k to k + 1.

    Attributes:
        slots: `[3 F]` which side: 3 * face + k.
        starts: `[E]` where each edge's sides begin in `slots`.
        counts: `[E]` how many faces each edge has.
    """

    slots: np.ndarray
    starts: np.ndarray
    counts: np.ndarray


class Hinges(NamedTuple):
    """Edges with exactly two faces.

    Attributes:
        faces: `[P, 2]` the two faces.
        sides: `[P, 2]` which side of each, 0 to 2.
        is_consistent: `[P]` whether both are wound alike: they run along the edge in opposite directions.
    """

    faces: np.ndarray
    sides: np.ndarray
    is_consistent: np.ndarray


def group_sides(faces: np.ndarray, num_units: int) -> Sides:
    """Sort the sides of all faces by edge, in an order that depends on nothing else."""
    faces = faces.astype(np.int64, copy=False)  # a key below is a number of units squared, times sides
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    num_slots = len(tail)
    edge = np.minimum(tail, head) * num_units + np.maximum(tail, head)
    keys = np.sort(edge * num_slots + np.arange(num_slots))
    edge, slots = np.divmod(keys, max(num_slots, 1))
    starts = np.flatnonzero(np.diff(edge, prepend=-1))
    return Sides(slots, starts, np.diff(starts, append=num_slots))


def is_in_sorted(wanted: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Return which of the wanted numbers are among ascending keys."""
    if len(keys) == 0:
        return np.zeros(len(wanted), dtype=bool)
    return keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted


def find_hinges(faces: np.ndarray, sides: Sides) -> Hinges:
    """Find the edges with exactly two faces."""
    first = sides.starts[sides.counts == 2]
    slots = np.stack([sides.slots[first], sides.slots[first + 1]], axis=1)
    tails = faces.ravel()[slots]
    return Hinges(slots // 3, slots % 3, tails[:, 0] != tails[:, 1])


def find_normals(units: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces' unit normals `[F, 3]`, zero for faces without area."""
    a = units[faces[:, 0]]
    normals = cross_rows(units[faces[:, 1]] - a, units[faces[:, 2]] - a)
    return normals / np.maximum(find_lengths(normals)[..., None], 1e-300)


def find_excess(sides: Sides, quality: np.ndarray) -> np.ndarray:
    """Return the faces `[D]` to drop so that no edge keeps more than two: worst first, none without need."""
    full = np.flatnonzero(sides.counts > 2)
    if len(full) == 0:
        return np.empty(0, dtype=np.int64)
    surplus: dict[int, int] = {}
    edges_of: dict[int, list[int]] = {}
    for edge, start, count in zip(
        full.tolist(), sides.starts[full].tolist(), sides.counts[full].tolist(), strict=True
    ):
        surplus[edge] = count - 2
        for slot in sides.slots[start : start + count].tolist():
            edges_of.setdefault(slot // 3, []).append(edge)
    dropped = []
    for face in sorted(edges_of, key=lambda face: (quality[face], face)):
        if any(surplus[edge] > 0 for edge in edges_of[face]):
            dropped.append(face)
            for edge in edges_of[face]:
                surplus[edge] -= 1
    return np.array(sorted(dropped))


def find_folds(units: np.ndarray, faces: np.ndarray, hinges: Hinges, quality: np.ndarray) -> np.ndarray:
    """Return the worse face `[D]` of every two that lie back to back: less than 60 degrees between them."""
    left, right = faces[hinges.faces[:, 0]], hinges.sides[:, 0]
    row = np.arange(len(left))
    tail, head = units[left[row, right]], units[left[row, (right + 1) % 3]]
    apexes = [units[faces[hinges.faces[:, k], (hinges.sides[:, k] + 2) % 3]] - tail for k in range(2)]
    along = head - tail
    along /= np.maximum(find_lengths(along)[..., None], 1e-300)
    first, second = (apex - (apex * along).sum(axis=1, keepdims=True) * along for apex in apexes)
    cosine = sum_rows(first * second)
    cosine /= np.maximum(find_lengths(first) * find_lengths(second), 1e-300)
    return _pick_worse(hinges.faces[cosine > FOLD_COSINE], quality)


def find_minor_fans(
    faces: np.ndarray, hinges: Hinges, quality: np.ndarray, is_suspect: np.ndarray
) -> np.ndarray:
    """Return the faces `[D]` outside the largest fan of a suspected corner: a pinched vertex has several fans.

    Args:
        faces: `[F, 3]`.
        hinges: of the faces.
        quality: `[F]` decides between fans of one size.
        is_suspect: `[U]` the vertices to look at.
    """
    vertex = faces.ravel()
    chosen = np.flatnonzero(is_suspect[vertex])
    if len(chosen) == 0:
        return chosen
    beside = _find_corners_beside(len(faces), hinges)[:, chosen]
    if len(chosen) < len(vertex):
        place = np.empty(len(vertex), dtype=np.int64)
        place[chosen] = np.arange(len(chosen))
        beside = place[beside]
    first = np.arange(len(chosen))
    while True:
        # Every corner takes the first corner of its fan that its neighbours know of, then the one that this knows of.
        earlier = np.minimum(first, np.minimum(first[beside[0]], first[beside[1]]))
        earlier = earlier[earlier]
        if (earlier == first).all():
            break
        first = earlier
    is_first = first == np.arange(len(chosen))
    num_fans = int(is_first.sum())
    if num_fans == np.count_nonzero(np.bincount(vertex[chosen])):
        return np.empty(0, dtype=np.int64)
    fan = (np.cumsum(is_first) - 1)[first]
    owner = np.empty(num_fans, dtype=np.int64)
    owner[fan] = vertex[chosen]
    size = np.bincount(fan, minlength=num_fans)
    worth = np.bincount(fan, quality[chosen // 3], minlength=num_fans)
    order = np.lexsort((np.arange(num_fans), -worth, -size, owner))
    is_kept = np.zeros(num_fans, dtype=bool)
    is_kept[order[np.diff(owner[order], prepend=-1) != 0]] = True
    return np.unique(chosen[~is_kept[fan]] // 3)


def _find_corners_beside(num_faces: int, hinges: Hinges) -> np.ndarray:
    """Return the corners behind the two sides of each at the same vertex: `[2, 3 F]`, itself at the border."""
    one, other = (3 * hinges.faces + hinges.sides).T
    after_one, after_other = (3 * hinges.faces + (hinges.sides + 1) % 3).T
    is_alike = hinges.is_consistent
    beside = np.stack([np.arange(3 * num_faces)] * 2)
    beside[0, one] = np.where(is_alike, after_other, other)
    beside[1, after_one] = np.where(is_alike, other, after_other)
    beside[0, other] = np.where(is_alike, after_one, one)
    beside[1, after_other] = np.where(is_alike, one, after_one)
    return beside


def find_suspects(faces: np.ndarray, sides: Sides, num_units: int) -> np.ndarray:
    """Return the vertices with more than two border edges, `[U]`: nearly all that are pinched."""
    slots = sides.slots[sides.starts[sides.counts == 1]]
    ends = np.concatenate([faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]])
    return np.bincount(ends, minlength=num_units) > 2


def orient_faces(
    units: np.ndarray, faces: np.ndarray, hinges: Hinges, quality: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Wind all faces alike along the flattest hinges.

    Returns:
        The faces, reversed where needed, and those `[D]` to drop because their winding contradicts a
        neighbour's: without them the surface is orientable.
    """
    if hinges.is_consistent.all():
        return faces, np.empty(0, dtype=np.int64)
    num_faces = len(faces)
    normals = find_normals(units, faces)
    cosine = np.abs(sum_rows(normals[hinges.faces[:, 0]] * normals[hinges.faces[:, 1]]))
    graph = coo_array((1.001 - cosine, tuple(hinges.faces.T)), shape=(num_faces, num_faces)).tocsr()
    tree = minimum_spanning_tree(graph).tocoo()
    _, part = connected_components(tree, directed=False)
    roots = np.unique(part, return_index=True)[1]
    # One root above all parts, so that a single walk reaches every face.
    ends = np.concatenate(
        [np.stack([tree.row, tree.col]), np.stack([np.full(len(roots), num_faces), roots])], 1
    )
    size = num_faces + 1
    forest = coo_array((np.ones(ends.shape[1]), ends), shape=(size, size)).tocsr()
    _, parent = breadth_first_order(forest, num_faces, directed=False)
    parent[num_faces] = num_faces
    sign = _find_relative_signs(faces, hinges, parent)
    while True:
        above = parent[parent]
        if (above == parent).all():
            break
        sign = sign * sign[parent]
        parent = above
    sign = sign[:num_faces]
    is_contradicted = np.where(hinges.is_consistent, 1, -1) * sign[hinges.faces].prod(axis=1) < 0
    wound = np.where((sign < 0)[:, None], faces[:, ::-1], faces)
    return wound, _pick_worse(hinges.faces[is_contradicted], quality)


def _find_relative_signs(faces: np.ndarray, hinges: Hinges, parent: np.ndarray) -> np.ndarray:
    """Return `[F + 1]` -1 where a face is wound against its parent in the tree, else 1."""
    sign = np.ones(len(faces) + 1, dtype=np.int64)
    low, high = hinges.faces[~hinges.is_consistent].T
    is_child = parent[low] == high
    sign[low[is_child]] = -1
    is_child = parent[high] == low
    sign[high[is_child]] = -1
    return sign


def _pick_worse(pairs: np.ndarray, quality: np.ndarray) -> np.ndarray:
    is_first = quality[pairs[:, 0]] <= quality[pairs[:, 1]]
    return np.unique(np.where(is_first, pairs[:, 0], pairs[:, 1]))


def make_manifold(units: np.ndarray, faces: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """Drop as few faces as needed: at most two an edge, no folds, orientable, one fan a vertex.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]` candidate faces, each at most once.
        quality: `[F]` the larger the better.

    Returns:
        `[F', 3]` faces, consistently wound within every connected part.
    """
    while len(faces):
        sides = group_sides(faces, len(units))
        dropped = find_excess(sides, quality)
        if len(dropped) == 0:
            hinges = find_hinges(faces, sides)
            is_suspect = find_suspects(faces, sides, len(units))
            dropped = np.union1d(
                find_folds(units, faces, hinges, quality), find_minor_fans(faces, hinges, quality, is_suspect)
            )
            if len(dropped) == 0:
                dropped = find_minor_fans(faces, hinges, quality, ~is_suspect)
            if len(dropped) == 0:
                faces, dropped = orient_faces(units, faces, hinges, quality)
        if len(dropped) == 0:
            return faces
        is_kept = np.ones(len(faces), dtype=bool)
        is_kept[dropped] = False
        faces, quality = faces[is_kept], quality[is_kept]
    return faces


def make_winding(units: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces wound alike as far as that is possible: along the flattest edges, none dropped."""
    if len(faces) == 0:
        return faces
    hinges = find_hinges(faces, group_sides(faces, len(units)))
    return orient_faces(units, faces, hinges, np.ones(len(faces)))[0]
