"""Marked vertices of a mesh: their rings of neighbors, and the connected parts they form."""

import numpy as np
from jaxtyping import Bool, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reconstruction._src.geometry.rows import any_corner


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
