"""Vertices at the same place joined, faces that are flat or given twice dropped."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from reconstruction.errors import ReconstructionError

_SAME_PLACE = 1e-6
"""Vertices closer than this, relative to the extent, are one: the resolution of single precision."""
_FLAT = 1e-6
"""A face whose height is smaller, relative to its longest edge, is flat."""
_SHORTEST = 1e-12
"""Keeps the square of an edge above zero [m]."""


def merge_vertices(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "F 3"]]:
    """Join vertices at the same place, to a millionth of the extent; drop those of no face."""
    used, numbers = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], numbers.reshape(-1, 3)
    keys = np.round(vertices / (_SAME_PLACE * float(np.ptp(vertices, axis=0).max()))).astype(np.int64)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return vertices[first], group.ravel()[faces]


def drop_flat_faces(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Int[np.ndarray, "G 3"]:
    """Drop faces without an area, and all but the first of faces with the same corners.

    Raises:
        ReconstructionError: no face is left.
    """
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    faces = faces[np.linalg.norm(normals, axis=1) > _FLAT * np.maximum(longest, _SHORTEST) ** 2]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if not len(first):
        raise ReconstructionError("every face of the mesh is flat (without an area)")
    return faces[np.sort(first)]
