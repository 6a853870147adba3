"""Take folds and self-intersections out of a fitted mesh, by moving vertices between their neighbors."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array

from reconstruction._src.geometry.manifold import (
    Hinges,
    find_ends,
    find_hinges,
    group_sides,
    make_manifold,
    widen,
)
from reconstruction._src.geometry.rows import (
    Faces,
    Vertices,
    any_rows,
    compute_area_vectors,
    compute_lengths,
    drop_unused,
    sum_by_owner,
    sum_rows,
)
from reconstruction._src.surfaces.intersections import FOLD_ANGLE, find_intersections, measure_bends

Marks = Bool[np.ndarray, " V"]  # Of each vertex, whether something holds

Chosen = Bool[np.ndarray, " F"]  # Of each face, whether it is one

_SHORTEST = float(np.finfo(np.float32).tiny)
"""Divided by instead of 0, also in single precision: the direction of an edge without length is 0."""


_STEP = 0.5
"""Share of the way to the center of its neighbors that a tangled face's vertex moves in a round; above 1 it
would overshoot."""
_STAGES = ((0, False), (0, True), (1, False), (1, True), (2, True), (3, True))
"""What moves, one stage after another: this many rings around the tangled faces, without or with the vertices
on the boundary. A boundary that stays keeps the ears of the mesh; where its teeth lie across one another, it
must move."""
_ROUNDS = 8  # A stage ends after this many without success; the next begins with the best result
_BOUNDARY_ANGLE = np.deg2rad(60)
"""Where the boundary turns by more, its faces may lie across one another without any fold [rad]: the teeth of
a closing slit."""
_SHARP_ANGLE = np.deg2rad(75)
"""Where the normals at an edge differ by more, its faces may intersect others without any fold [rad]: lips
over a narrow groove."""


def find_folded(vertices: Vertices, faces: Faces) -> Chosen:
    """Return which faces lie against the mean normal, by area, of those around their corners."""
    cross = compute_area_vectors(vertices, faces)
    at_vertex = sum_by_owner(faces.ravel(), np.repeat(cross, 3, axis=0), len(vertices))
    return sum_rows(at_vertex[faces].sum(axis=1) * cross) < 0


def find_tangled(
    vertices: Vertices,
    faces: Faces,
    hinges: Hinges,
    is_suspect: Chosen,
    is_changed: Chosen,
    is_tested: Chosen | None = None,
) -> Chosen:
    """Return which faces are folded, or intersect another.

    These are looked for at suspects, and at sharp edges of faces that changed since they were looked for last.
    """
    is_tangled = find_folded(vertices, faces)
    cosine = measure_bends(vertices, faces, hinges)
    is_tangled[hinges.faces[cosine < np.cos(FOLD_ANGLE)]] = True
    is_suspect = is_suspect | is_tangled
    sharp = hinges.faces[cosine < np.cos(_SHARP_ANGLE)]
    is_suspect[sharp[any_rows(is_changed[sharp])]] = True
    if is_tested is not None:
        is_suspect &= is_tested
    if is_suspect.any():
        is_tangled[find_intersections(vertices, faces, is_suspect)] = True
    return is_tangled if is_tested is None else is_tangled & is_tested


def untangle(vertices: Vertices, faces: Faces) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Do what `unfold_faces` does; of faces that still lie across others, those across the most go.

    Vertices that are left without a face go with them.
    """
    vertices, is_tangled = unfold_faces(vertices, faces)
    if is_tangled.any():
        faces = make_manifold(vertices, faces, np.zeros(len(faces)))  # no fold is left
        while len(pairs := find_intersections(vertices, faces)):
            faces = np.delete(faces, np.bincount(pairs.ravel()).argmax(), axis=0)
            faces = make_manifold(vertices, faces, np.zeros(len(faces)))
        vertices, faces = drop_unused(vertices, faces)
    return vertices, faces


def unfold_faces(
    vertices: Vertices, faces: Faces, is_movable: Marks | None = None
) -> tuple[Vertices, Chosen]:
    """Return the vertices with those of tangled faces moved between their neighbors, and the faces still tangled.

    A vertex on the boundary moves between its neighbors on the boundary. Only where this does not suffice, the
    vertices around them move, too.
    """
    is_tested = None if is_movable is None else any_rows(is_movable[faces])
    sides = group_sides(faces, len(vertices))
    hinges, (tail, head) = find_hinges(faces, sides), find_ends(faces, sides.slots[sides.starts])
    is_boundary_edge = sides.counts == 1
    is_turn = _find_turns(vertices, tail[is_boundary_edge], head[is_boundary_edge])
    every = np.ones(len(faces), dtype=bool)
    best = find_tangled(vertices, faces, hinges, any_rows(is_turn[faces]), every, is_tested)
    if not best.any():
        return vertices, best
    neighbors, is_boundary = _join_neighbors(tail, head, is_boundary_edge, len(vertices))
    is_fixed = np.zeros(len(vertices), dtype=bool) if is_movable is None else ~is_movable
    for rings, moves_boundary in _STAGES:
        current, tangled, left = vertices, best, _ROUNDS
        while left > 0 and best.any():
            is_moved = np.zeros(len(vertices), dtype=bool)
            is_moved[faces[tangled]] = True
            is_moved = widen(faces, is_moved, rings)
            is_moved &= (~is_boundary | moves_boundary) & ~is_fixed
            moved = np.flatnonzero(is_moved)
            around = neighbors[moved]
            share = np.asarray(around.sum(axis=1)).reshape(-1, 1)
            current = current.copy()
            current[moved] += _STEP * (around @ current / share - current[moved])
            is_changed = any_rows(is_moved[faces])
            tangled = find_tangled(current, faces, hinges, tangled | is_changed, is_changed, is_tested)
            left -= 1
            if tangled.sum() < best.sum():
                vertices, best, left = current, tangled, _ROUNDS
    return vertices, best


def _find_turns(vertices: Vertices, tail: Int[np.ndarray, " B"], head: Int[np.ndarray, " B"]) -> Marks:
    """Return at which vertices the boundary, edges from tail to head, turns by more than `_BOUNDARY_ANGLE`."""
    along = vertices[head] - vertices[tail]
    along /= np.maximum(compute_lengths(along)[:, None], _SHORTEST)
    arriving, leaving = np.zeros((2, len(vertices), 3))
    arriving[head], leaving[tail] = along, along
    is_turn = np.zeros(len(vertices), dtype=bool)
    is_turn[tail] = sum_rows(arriving[tail] * leaving[tail]) < np.cos(_BOUNDARY_ANGLE)
    return is_turn


def _join_neighbors(
    tail: Int[np.ndarray, " E"],
    head: Int[np.ndarray, " E"],
    is_boundary_edge: Bool[np.ndarray, " E"],
    num_vertices: int,
) -> tuple[csr_array, Bool[np.ndarray, " {num_vertices}"]]:
    """Return a matrix `[V, V]`, 1 where two vertices share an edge, and which vertices are on the boundary.

    Vertices on the boundary are joined by boundary edges only.
    """
    is_boundary_edge = np.tile(is_boundary_edge, 2)
    owner, other = np.concatenate([tail, head]), np.concatenate([head, tail])
    is_boundary = np.zeros(num_vertices, dtype=bool)
    is_boundary[owner[is_boundary_edge]] = True
    is_kept = ~is_boundary[owner] | is_boundary_edge
    owner, other = owner[is_kept], other[is_kept]
    shape = (num_vertices, num_vertices)
    return csr_array((np.ones(len(owner)), (owner, other)), shape=shape), is_boundary
