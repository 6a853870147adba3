"""Which points lie on a surface that is sampled as sparsely as they are: a far wall, not a stray or mixed reading."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree


class Surroundings(NamedTuple):
    """What the neighbors of some points show.

    Attributes:
        is_flat: whether a point lies with them on a plane, and is as sparse as they are.
        is_alike: whether it is as sparse as they are.
        neighbors: their indices.
        normals: of the planes through them.
    """

    is_flat: Bool[np.ndarray, " S"]
    is_alike: Bool[np.ndarray, " S"]
    neighbors: Int[np.ndarray, "S K"]
    normals: Float[np.ndarray, "S 3"]


def find_flat(
    points: Float[np.ndarray, "N 3"],
    chosen: Int[np.ndarray, " S"],
    num_neighbors: int,
    max_flatness: float,
    max_loneliness: float,
) -> Surroundings:
    """Find which of the chosen points lie with their neighbors on a plane, and which are as sparse as these."""
    num_neighbors = min(num_neighbors, len(points) - 1)
    if not len(chosen) or num_neighbors < 1:
        none = np.zeros(len(chosen), bool)
        return Surroundings(none, none, np.zeros((len(chosen), 1), np.int64), np.zeros((len(chosen), 3)))
    tree = cKDTree(points)
    distances, neighbors = tree.query(points[chosen], k=num_neighbors + 1)
    others = np.unique(neighbors)
    reach = np.zeros(len(points))
    reach[others] = tree.query(points[others], k=num_neighbors + 1)[0][:, -1]
    offset = points[neighbors] - points[neighbors].mean(axis=1, keepdims=True)
    variance, axes = np.linalg.eigh(np.swapaxes(offset, 1, 2) @ offset)
    is_alike = distances[:, -1] < max_loneliness * np.median(reach[neighbors], axis=1)
    is_flat = is_alike & (variance[:, 0] < max_flatness * variance[:, 2])
    return Surroundings(is_flat, is_alike, neighbors[:, 1:], axes[:, :, 0])
