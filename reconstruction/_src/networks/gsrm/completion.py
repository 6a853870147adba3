"""Find what a map has left uncovered in an uneven cloud: groups of samples far from every face.

Samples that are sparse against the rest (a far wall, what is seen through a door) may count as outliers, their faces as
debris, or their units may be too few to see one another. Such groups are a surface of their own: a map grows
over them alone, where they are the rule, and is put beside the first.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import Faces, Points, Vertices, compute_lengths

PASSES = 2  # How often the rest is looked for; 0: never
_NEIGHBORS = 8  # Samples around a sample that measure its spacing
_COMPLETION_GAP = 2.5
"""A sample farther than this from every face is uncovered. Lower, and what stands off by noise is covered
twice; higher, and strips along the rims of the surface stay bare."""
_EDGE_SHARE = 0.75
"""Nor is it uncovered nearer than this share of the mean edge of the map: faces cut corners."""
_LINK = 3.0  # Uncovered samples nearer to one another than this are one group
_MIN_SAMPLES = 12  # A smaller group is stray: mixed pixels, insects, dust
_FLATNESS = 0.06
"""Least variance over the largest of a sample and its neighbors, below which they are flat; of samples that
fill space it is 0.1 to 0.5."""
_FLAT_SHARE = 0.35  # A group of which a smaller share of the samples is flat fills space: no surface
SAMPLES_PER_UNIT = 4.0  # Samples of such a group for each new unit. They are sparse, so fewer than usual.
MAX_SHARE = 0.25  # The most new units in all, as a share of those wanted


def find_uncovered(samples: Points, vertices: Vertices, faces: Faces) -> Bool[np.ndarray, " N"]:
    """Return which samples belong to a group that no face covers."""
    import igl

    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    squared = np.asarray(igl.point_mesh_squared_distance(samples.astype(np.float64), vertices, faces)[0])
    corners = vertices[faces]
    edge = compute_lengths(corners - np.roll(corners, 1, axis=1)).mean()
    far = np.flatnonzero(squared > (_EDGE_SHARE * edge) ** 2)
    is_uncovered = np.zeros(len(samples), dtype=bool)
    num_neighbors = min(_NEIGHBORS, len(samples) - 1)
    if len(far) < _MIN_SAMPLES:
        return is_uncovered
    distances, neighbors = cKDTree(samples).query(samples[far], k=num_neighbors + 1)
    spacing = distances[:, -1] * np.sqrt(np.pi / num_neighbors)
    is_far = squared[far] > (_COMPLETION_GAP * spacing) ** 2
    is_flat = _compute_flatness(samples[neighbors[is_far]]) < _FLATNESS
    far = far[is_far]
    is_uncovered[far] = _find_groups(samples[far], spacing[is_far], is_flat)
    return is_uncovered


def _find_groups(
    samples: Points, spacing: Float[np.ndarray, " N"], is_flat: Bool[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return which samples are in a group that is large and flat enough."""
    if len(samples) < _MIN_SAMPLES:
        return np.zeros(len(samples), dtype=bool)
    distances, others = cKDTree(samples).query(samples, k=_MIN_SAMPLES)
    is_near = distances <= _LINK * spacing[:, None]
    first = np.broadcast_to(np.arange(len(samples))[:, None], others.shape)[is_near]
    graph = coo_array((np.ones(len(first)), (first, others[is_near])), shape=(len(samples), len(samples)))
    group = connected_components(graph, directed=False)[1]
    size = np.bincount(group)
    is_surface = np.bincount(group, is_flat) >= _FLAT_SHARE * size
    for number in np.flatnonzero((size >= _MIN_SAMPLES) & ~is_surface):
        # Where noise exceeds the spacing, only the whole group shows that it is flat.
        is_surface[number] = _compute_flatness(samples[None, group == number])[0] < _FLATNESS
    return (is_surface & (size >= _MIN_SAMPLES))[group]


def _compute_flatness(neighborhoods: Float[np.ndarray, "M K 3"]) -> Float[np.ndarray, " M"]:
    """Return the least variance of neighborhoods over their largest."""
    offset = neighborhoods - neighborhoods.mean(axis=1, keepdims=True)
    variance = np.linalg.eigvalsh(np.swapaxes(offset, 1, 2) @ offset)
    return variance[:, 0] / np.maximum(variance[:, 2], 1e-300)
