"""The rest of a surface in parts whose boxes are tight, so that most beams pass most of them at a glance."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.surfaces.primitives.primitive import Primitive


def split_rest(
    corners: Float[np.ndarray, "F 3 3"], primitives: list[Primitive], reach: float, apart: float, fewest: int
) -> list[Float[np.ndarray, "G 3 3"]]:
    """Divide triangles into those around each plane, and all others into groups that are apart.

    The tree of triangles of a whole room is hollow: a beam meets a box at each of its levels. Walls are flat parts, and
    furniture is small ones.
    """
    label = np.full(len(corners), -1)
    for number, plane in enumerate(primitives):
        if plane.kind == "plane":
            distance = np.abs((corners - plane.center) @ plane.axes[:, 2])
            is_near = (distance <= reach).all(axis=1) & (label < 0)
            if is_near.sum() >= fewest:
                label[is_near] = number
    walls = [corners[label == k] for k in np.unique(label[label >= 0])]
    others = corners[label < 0]
    return walls + (_split_by_place(others, apart, fewest) if len(others) else [])


def _split_by_place(
    corners: Float[np.ndarray, "F 3 3"], apart: float, fewest: int
) -> list[Float[np.ndarray, "G 3 3"]]:
    keys = np.floor(corners.mean(axis=1) / apart).astype(np.int64)
    cells, index = np.unique(keys, axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(1.0, p=np.inf, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(cells), len(cells)))
    label = connected_components(graph, directed=False)[1][index.ravel()]
    label = np.where(np.bincount(label)[label] >= fewest, label, -1)
    return [corners[label == k] for k in np.unique(label)]
