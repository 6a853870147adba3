"""Take folds out of a fitted mesh: faces that came to lie against the surface round them."""

import numpy as np
from scipy.sparse import coo_array

from reconstruction.surfaces.manifold import group_sides
from reconstruction.surfaces.rows import cross_rows, sum_rows

MAX_ROUNDS = 16
STEP = 0.5
"""Share of the way to the middle of its neighbours that a folded face's vertex goes in a round."""


def find_folded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return which faces lie against the mean normal, by area, of those round their corners: `[F]`."""
    a = vertices[faces[:, 0]]
    cross = cross_rows(vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a)
    flat = faces.ravel()
    at_vertex = np.stack(
        [np.bincount(flat, np.repeat(cross[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1
    )
    return sum_rows(at_vertex[faces].sum(axis=1) * cross) < 0


def unfold_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertices with those of folded faces moved between their neighbours, while that helps.

    A vertex on the rim goes between its neighbours on the rim.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]` of an oriented two-manifold.
    """
    folded = np.flatnonzero(find_folded(vertices, faces))
    if len(folded) == 0:
        return vertices
    neighbors = _join_neighbors(faces, len(vertices))
    best, current = vertices, vertices
    fewest = len(folded)
    for _ in range(MAX_ROUNDS):
        moved = np.unique(faces[folded])
        around = neighbors[moved]
        share = np.asarray(around.sum(axis=1)).reshape(-1, 1)
        current = current.copy()
        current[moved] += STEP * (around @ current / share - current[moved])
        folded = np.flatnonzero(find_folded(current, faces))
        if len(folded) < fewest:
            best, fewest = current, len(folded)
        if len(folded) == 0:
            break
    return best


def _join_neighbors(faces: np.ndarray, num_vertices: int):
    """Return a sparse matrix `[V, V]`: 1 where two vertices share an edge; on the rim, where it is a rim edge."""
    sides = group_sides(faces, num_vertices)
    slots = sides.slots[sides.starts]
    tail, head = faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]
    is_rim_edge = sides.counts == 1
    is_rim = np.zeros(num_vertices, dtype=bool)
    is_rim[tail[is_rim_edge]] = is_rim[head[is_rim_edge]] = True
    owner, other = np.concatenate([tail, head]), np.concatenate([head, tail])
    is_kept = ~is_rim[owner] | np.tile(is_rim_edge, 2)
    owner, other = owner[is_kept], other[is_kept]
    return coo_array((np.ones(len(owner)), (owner, other)), shape=(num_vertices, num_vertices)).tocsr()
