"""Faces that share sides: find them, and drop faces until the mesh is an orientable two-manifold."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int, Num
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from reconstruction._src.geometry.rows import (
    Faces,
    Vertices,
    any_rows,
    compute_lengths,
    sum_by_owner,
    sum_rows,
)

_FOLD_COSINE = 0.5
"""Cosine of the angle that two faces at an edge enclose at least, 60 degrees: the sharpest wedge that a network of
faces of one size can show; what is sharper doubles back."""
_TIE_BREAK = 1e-3
"""Added to the weight of every hinge, whose least value is 0: a sparse graph has no edges of weight 0."""
_SHORTEST = 1e-300  # Divided by instead of 0: the direction of what has no length is 0


class Sides(NamedTuple):
    """The sides of all faces, sorted by the edge they lie on; side k of a face runs from corner k to k + 1."""

    slots: Int[np.ndarray, " S"]  # which side: 3 * face + k
    starts: Int[np.ndarray, " E"]  # where each edge's sides begin in `slots`
    counts: Int[np.ndarray, " E"]  # how many faces each edge has
    # the lower of its two vertices times the number of vertices, plus the higher; ascending
    keys: Int[np.ndarray, " E"]


class Hinges(NamedTuple):
    """Edges with exactly two faces."""

    faces: Int[np.ndarray, "P 2"]  # the two faces
    sides: Int[np.ndarray, "P 2"]  # which side of each, 0 to 2
    # whether both are wound alike: they run along the edge in opposite directions
    is_consistent: Bool[np.ndarray, " P"]


def group_sides(faces: Faces, num_vertices: int) -> Sides:
    """Sort the sides of all faces by edge, in an order that depends on nothing else."""
    faces = faces.astype(np.int64, copy=False)  # a key below is a number of vertices squared, times sides
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    num_slots = len(tail)
    edge = np.minimum(tail, head) * num_vertices + np.maximum(tail, head)
    keys = np.sort(edge * num_slots + np.arange(num_slots))
    edge, slots = np.divmod(keys, max(num_slots, 1))
    starts = np.flatnonzero(np.diff(edge, prepend=-1))
    return Sides(slots, starts, np.diff(starts, append=num_slots), edge[starts])


def find_ends(
    faces: Faces, slots: Int[np.ndarray, " S"]
) -> tuple[Int[np.ndarray, " S"], Int[np.ndarray, " S"]]:
    """Return the vertices where sides, 3 * face + k, begin and end."""
    return faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]


def is_in_sorted(wanted: Int[np.ndarray, " N"], keys: Int[np.ndarray, " K"]) -> Bool[np.ndarray, " N"]:
    """Return which of the wanted numbers are among ascending keys."""
    if len(keys) == 0:
        return np.zeros(len(wanted), dtype=bool)
    return keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted


def find_hinges(faces: Faces, sides: Sides) -> Hinges:
    """Find the edges with exactly two faces."""
    first = sides.starts[sides.counts == 2]
    slots = np.stack([sides.slots[first], sides.slots[first + 1]], axis=1)
    tails = faces.ravel()[slots]
    return Hinges(slots // 3, slots % 3, tails[:, 0] != tails[:, 1])


def label_parts(pairs: Int[np.ndarray, "P 2"], count: int) -> Int[np.ndarray, " {count}"]:
    """Return the part of each of `count` things, of which pairs are joined; parts count from 0 by their first thing."""
    graph = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def compute_normals(vertices: Vertices, faces: Faces) -> Float64[np.ndarray, "F 3"]:
    """Return the faces' unit normals, zero for faces without area."""
    import igl

    return np.asarray(igl.per_face_normals(vertices, faces, np.zeros(3)))


def compute_vertex_normals(vertices: Vertices, faces: Faces) -> Vertices:
    """Return the sum of the unit normals of the faces around every vertex, not normalized."""
    normals = compute_normals(vertices, faces)
    return sum_by_owner(faces.ravel(), np.repeat(normals, 3, axis=0), len(vertices))


def find_excess(sides: Sides, quality: Num[np.ndarray, " F"]) -> Int[np.ndarray, " D"]:
    """Return the faces to drop so that no edge keeps more than two: worst first, only as many as needed."""
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


def find_folds(
    vertices: Vertices, faces: Faces, hinges: Hinges, quality: Num[np.ndarray, " F"]
) -> Int[np.ndarray, " D"]:
    """Return the worse face of every two that double back: the angle between them is below 60 degrees."""
    left, right = faces[hinges.faces[:, 0]], hinges.sides[:, 0]
    row = np.arange(len(left))
    tail, head = vertices[left[row, right]], vertices[left[row, (right + 1) % 3]]
    apexes = [vertices[faces[hinges.faces[:, k], (hinges.sides[:, k] + 2) % 3]] - tail for k in range(2)]
    along = head - tail
    along /= np.maximum(compute_lengths(along)[..., None], _SHORTEST)
    first, second = (apex - (apex * along).sum(axis=1, keepdims=True) * along for apex in apexes)
    cosine = sum_rows(first * second)
    cosine /= np.maximum(compute_lengths(first) * compute_lengths(second), _SHORTEST)
    return _pick_worse(hinges.faces[cosine > _FOLD_COSINE], quality)


def find_minor_fans(
    faces: Faces, hinges: Hinges, quality: Num[np.ndarray, " F"], is_suspect: Bool[np.ndarray, " V"]
) -> Int[np.ndarray, " D"]:
    """Return the faces outside the largest fan of a suspected corner: a pinched vertex has several fans."""
    vertex = faces.ravel()
    selected = np.flatnonzero(is_suspect[vertex])
    if len(selected) == 0:
        return selected
    adjacent = _find_adjacent_corners(len(faces), hinges)[:, selected]
    if len(selected) < len(vertex):
        place = np.empty(len(vertex), dtype=np.int64)
        place[selected] = np.arange(len(selected))
        adjacent = place[adjacent]
    first = np.arange(len(selected))
    while True:
        # Every corner takes the first corner of its fan that its neighbors have found, then what that one has found.
        earlier = np.minimum(first, np.minimum(first[adjacent[0]], first[adjacent[1]]))
        earlier = earlier[earlier]
        if (earlier == first).all():
            break
        first = earlier
    is_first = first == np.arange(len(selected))
    num_fans = int(is_first.sum())
    if num_fans == np.count_nonzero(np.bincount(vertex[selected])):
        return np.empty(0, dtype=np.int64)
    fan = (np.cumsum(is_first) - 1)[first]
    owner = np.empty(num_fans, dtype=np.int64)
    owner[fan] = vertex[selected]
    size = np.bincount(fan, minlength=num_fans)
    worth = np.bincount(fan, quality[selected // 3], minlength=num_fans)
    order = np.lexsort((np.arange(num_fans), -worth, -size, owner))
    is_kept = np.zeros(num_fans, dtype=bool)
    is_kept[order[np.diff(owner[order], prepend=-1) != 0]] = True
    return np.unique(selected[~is_kept[fan]] // 3)


def _find_adjacent_corners(num_faces: int, hinges: Hinges) -> Int[np.ndarray, "2 {3*num_faces}"]:
    """Return the corners at the same vertex behind the two sides of each; itself at the border."""
    one, other = (3 * hinges.faces + hinges.sides).T
    after_one, after_other = (3 * hinges.faces + (hinges.sides + 1) % 3).T
    is_alike = hinges.is_consistent
    adjacent = np.stack([np.arange(3 * num_faces)] * 2)
    adjacent[0, one] = np.where(is_alike, after_other, other)
    adjacent[1, after_one] = np.where(is_alike, other, after_other)
    adjacent[0, other] = np.where(is_alike, after_one, one)
    adjacent[1, after_other] = np.where(is_alike, one, after_one)
    return adjacent


def find_loops(faces: Faces, num_vertices: int) -> list[list[int]]:
    """Return the boundary loops; a face wound along a loop is wound like its neighbors."""
    sides = group_sides(faces, num_vertices)
    tail, head = find_ends(faces, sides.slots[sides.starts[sides.counts == 1]])
    following = dict(zip(head.tolist(), tail.tolist(), strict=True))
    loops = []
    while following:
        start, vertex = following.popitem()
        loop = [start]
        while vertex != start:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(loop)
    return loops


def find_border_vertices(faces: Faces, num_vertices: int) -> Bool[np.ndarray, " {num_vertices}"]:
    """Return which vertices are at the end of an edge with one face."""
    sides = group_sides(faces, num_vertices)
    is_border = np.zeros(num_vertices, dtype=bool)
    is_border[np.concatenate(find_ends(faces, sides.slots[sides.starts[sides.counts == 1]]))] = True
    return is_border


def widen(faces: Faces, is_marked: Bool[np.ndarray, " V"], rings: int) -> Bool[np.ndarray, " V"]:
    """Return the marked vertices and `rings` rings of neighbors."""
    is_marked = is_marked.copy()
    for _ in range(rings):
        is_marked[faces[any_rows(is_marked[faces])]] = True
    return is_marked


def spread(
    faces: Faces, is_marked: Bool[np.ndarray, " V"], is_allowed: Bool[np.ndarray, " V"]
) -> Bool[np.ndarray, " V"]:
    """Return the marked vertices and the allowed ones that are joined to them by allowed ones."""
    while True:
        wider = is_marked | widen(faces, is_marked, 1) & is_allowed
        if (wider == is_marked).all():
            return is_marked
        is_marked = wider


def find_suspects(faces: Faces, sides: Sides, num_vertices: int) -> Bool[np.ndarray, " {num_vertices}"]:
    """Return which vertices have more than two border edges: nearly all that are pinched."""
    slots = sides.slots[sides.starts[sides.counts == 1]]
    ends = np.concatenate(find_ends(faces, slots))
    return np.bincount(ends, minlength=num_vertices) > 2


def orient_faces(
    vertices: Vertices, faces: Faces, hinges: Hinges, quality: Num[np.ndarray, " F"]
) -> tuple[Faces, Int[np.ndarray, " D"]]:
    """Wind all faces alike along the flattest hinges.

    libigl's `bfs_orient` takes hinges as they come, and does not say where the winding contradicts itself.
    """
    if hinges.is_consistent.all():
        return faces, np.empty(0, dtype=np.int64)
    num_faces = len(faces)
    normals = compute_normals(vertices, faces)
    cosine = np.abs(sum_rows(normals[hinges.faces[:, 0]] * normals[hinges.faces[:, 1]]))
    graph = coo_array((1 + _TIE_BREAK - cosine, tuple(hinges.faces.T)), shape=(num_faces, num_faces)).tocsr()
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
    sign = _compute_relative_signs(faces, hinges, parent)
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


def _compute_relative_signs(
    faces: Faces, hinges: Hinges, parent: Int[np.ndarray, " F+1"]
) -> Int[np.ndarray, " F+1"]:
    """Return -1 where a face is wound against its parent in the tree, else 1."""
    sign = np.ones(len(faces) + 1, dtype=np.int64)
    low, high = hinges.faces[~hinges.is_consistent].T
    is_child = parent[low] == high
    sign[low[is_child]] = -1
    is_child = parent[high] == low
    sign[high[is_child]] = -1
    return sign


def _pick_worse(pairs: Int[np.ndarray, "P 2"], quality: Num[np.ndarray, " F"]) -> Int[np.ndarray, " D"]:
    is_first = quality[pairs[:, 0]] <= quality[pairs[:, 1]]
    return np.unique(np.where(is_first, pairs[:, 0], pairs[:, 1]))


def make_manifold(vertices: Vertices, faces: Faces, quality: Num[np.ndarray, " F"]) -> Int[np.ndarray, "M 3"]:
    """Drop as few faces as needed: at most two an edge, no folds, orientable, one fan a vertex."""
    while len(faces):
        sides = group_sides(faces, len(vertices))
        dropped = find_excess(sides, quality)
        if len(dropped) == 0:
            hinges = find_hinges(faces, sides)
            is_suspect = find_suspects(faces, sides, len(vertices))
            dropped = np.union1d(
                find_folds(vertices, faces, hinges, quality),
                find_minor_fans(faces, hinges, quality, is_suspect),
            )
            if len(dropped) == 0:
                dropped = find_minor_fans(faces, hinges, quality, ~is_suspect)
            if len(dropped) == 0:
                faces, dropped = orient_faces(vertices, faces, hinges, quality)
        if len(dropped) == 0:
            return faces
        is_kept = np.ones(len(faces), dtype=bool)
        is_kept[dropped] = False
        faces, quality = faces[is_kept], quality[is_kept]
    return faces


def make_winding(vertices: Vertices, faces: Faces) -> Faces:
    """Return the faces wound alike as far as that is possible: along the flattest edges, none dropped."""
    if len(faces) == 0:
        return faces
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    return orient_faces(vertices, faces, hinges, np.ones(len(faces)))[0]
