"""Take folds and self-intersections out of a fitted mesh, by moving vertices between their neighbours."""

import numpy as np
from scipy.sparse import csr_array

from reconstruction.geometry.manifold import Sides, group_sides
from reconstruction.geometry.rows import any_corner, cross_rows, find_lengths, sum_rows
from reconstruction.surfaces.intersections import find_folded_edges, find_intersections

STEP = 0.5
"""Share of the way to the middle of its neighbours that a tangled face's vertex goes in a round."""
STAGES = ((0, False), (0, True), (1, False), (1, True), (2, True), (3, True))
"""What moves, one after another: so many rings about the tangled faces, without or with the vertices on the rim. A rim
that stays put spares the ears of the mesh; where its teeth lie across one another, it must move."""
ROUNDS = 8
"""A stage ends after so many rounds in vain; the next begins with the best that was found."""
RIM_TURN = np.cos(np.deg2rad(60))
"""Where the rim turns by more, its faces may lie across one another without any fold: the teeth of a closing slit."""


SHARP_ANGLE = np.deg2rad(75)
"""Where an edge is sharper, its faces may intersect others without any fold: lips over a narrow groove."""


def find_folded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return which faces lie against the mean normal, by area, of those round their corners: `[F]`."""
    a = vertices[faces[:, 0]]
    cross = cross_rows(vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a)
    flat = faces.ravel()
    at_vertex = np.stack(
        [np.bincount(flat, np.repeat(cross[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1
    )
    return sum_rows(at_vertex[faces].sum(axis=1) * cross) < 0


def find_tangled(vertices: np.ndarray, faces: np.ndarray, is_suspect: np.ndarray) -> np.ndarray:
    """Return which faces are folded, or intersect another: `[F]`.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]` of an oriented two-manifold.
        is_suspect: `[F]` of these, and of those at sharp edges, it is asked whether they intersect others.
    """
    is_tangled = find_folded(vertices, faces)
    sharp = find_folded_edges(vertices, faces, SHARP_ANGLE)
    if len(sharp):
        is_tangled[find_folded_edges(vertices, faces)] = True
    is_suspect = is_suspect | is_tangled
    is_suspect[sharp] = True
    if is_suspect.any():
        is_tangled[find_intersections(vertices, faces, is_suspect)] = True
    return is_tangled


def unfold_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertices with those of tangled faces moved between their neighbours, while that helps.

    A vertex on the rim goes between its neighbours on the rim. Only where these do not suffice, the vertices about
    them move, too.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]` of an oriented two-manifold.
    """
    sides = group_sides(faces, len(vertices))
    is_suspect = any_corner(_find_turns(vertices, faces, sides), faces)
    is_tangled = find_tangled(vertices, faces, is_suspect)
    if not is_tangled.any():
        return vertices
    neighbors, is_rim = _join_neighbors(faces, len(vertices), sides)
    best, fewest = vertices, is_tangled.sum()
    for rings, moves_rim in STAGES:
        current, left = best, ROUNDS
        is_tangled = find_tangled(current, faces, is_suspect)
        while left > 0 and fewest > 0:
            is_moved = _widen(is_tangled, faces, len(vertices), rings) & (~is_rim | moves_rim)
            moved = np.flatnonzero(is_moved)
            around = neighbors[moved]
            share = np.asarray(around.sum(axis=1)).reshape(-1, 1)
            current = current.copy()
            current[moved] += STEP * (around @ current / share - current[moved])
            is_suspect = is_suspect | any_corner(is_moved, faces)
            is_tangled = find_tangled(current, faces, is_suspect)
            left -= 1
            if is_tangled.sum() < fewest:
                best, fewest, left = current, is_tangled.sum(), ROUNDS
    return best


def _widen(is_chosen: np.ndarray, faces: np.ndarray, num_vertices: int, rings: int) -> np.ndarray:
    """Return the vertices of the chosen faces, and so many rings about them: `[V]`."""
    is_inside = np.zeros(num_vertices, dtype=bool)
    is_inside[faces[is_chosen]] = True
    for _ in range(rings):
        is_inside[faces[any_corner(is_inside, faces)]] = True
    return is_inside


def _find_turns(vertices: np.ndarray, faces: np.ndarray, sides: Sides) -> np.ndarray:
    """Return the vertices where the rim turns sharply: `[V]`."""
    tail, head = _find_rim(faces, sides)
    along = vertices[head] - vertices[tail]
    along /= np.maximum(find_lengths(along)[:, None], 1e-300)
    arriving, leaving = np.zeros((2, len(vertices), 3))
    arriving[head], leaving[tail] = along, along
    is_turn = np.zeros(len(vertices), dtype=bool)
    is_turn[tail] = sum_rows(arriving[tail] * leaving[tail]) < RIM_TURN
    return is_turn


def _find_rim(faces: np.ndarray, sides: Sides) -> tuple[np.ndarray, np.ndarray]:
    """Return where the edges of the rim begin and end: `[B]` each."""
    slots = sides.slots[sides.starts[sides.counts == 1]]
    return faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]


def _join_neighbors(faces: np.ndarray, num_vertices: int, sides: Sides) -> tuple[csr_array, np.ndarray]:
    """Return a matrix `[V, V]`, 1 where two vertices share an edge, on the rim a rim edge; and who is on the rim."""
    slots = sides.slots[sides.starts]
    tail, head = faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]
    is_rim_edge = np.tile(sides.counts == 1, 2)
    owner, other = np.concatenate([tail, head]), np.concatenate([head, tail])
    is_rim = np.zeros(num_vertices, dtype=bool)
    is_rim[owner[is_rim_edge]] = True
    is_kept = ~is_rim[owner] | is_rim_edge
    owner, other = owner[is_kept], other[is_kept]
    shape = (num_vertices, num_vertices)
    return csr_array((np.ones(len(owner)), (owner, other)), shape=shape), is_rim
