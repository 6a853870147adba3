"""Meshes with fewer vertices and faces: what is given twice joined, what is flat dropped, the rest decimated."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ReconstructionError

_SAME_PLACE = 1e-6
"""Vertices closer than this, relative to the extent, are one: the resolution of single precision."""
_FLAT = 1e-6
"""A face whose height is smaller, relative to its longest edge, is flat."""
_SHORTEST = 1e-12
"""Keeps the square of an edge above zero [m]."""
_OVERSHOOT = 0.02
"""Quadric decimation may leave the bounds of the mesh by this share of the extent; beyond, it has gone wrong."""


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
    """Drop faces without an area, and all but the first of faces with the same corners."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    faces = faces[np.linalg.norm(normals, axis=1) > _FLAT * np.maximum(longest, _SHORTEST) ** 2]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if not len(first):
        raise ReconstructionError("every face of the mesh is flat (without an area)")
    return faces[np.sort(first)]


def decimate(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], count: int
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Return about `count` faces by quadric decimation; the result may be wrecked: check it."""
    import fast_simplification

    if count >= len(faces):
        return vertices, faces
    arrays: Any = fast_simplification.simplify(
        np.ascontiguousarray(vertices, dtype=np.float32),  # pyright: ignore[reportArgumentType]
        np.ascontiguousarray(faces, dtype=np.int32),
        target_count=count,
    )
    return np.asarray(arrays[0], dtype=np.float64), np.asarray(arrays[1], dtype=np.int64)


def simplify(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], count: int
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Return about `count` faces by quadric decimation, or by clustering vertices where that wrecks the mesh."""
    before = merge_vertices(vertices, faces)
    vertices, faces = decimate(*before, count)
    is_sound = len(faces) > 0 and np.isfinite(vertices).all()
    if is_sound:
        low, high = before[0].min(axis=0), before[0].max(axis=0)
        reach = _OVERSHOOT * float((high - low).max())
        is_sound = bool((vertices >= low - reach).all() and (vertices <= high + reach).all())
    if not is_sound or len(faces) > 2 * count:
        cell = float(np.ptp(before[0], axis=0).max()) / np.sqrt(count)
        _, first, group = np.unique(
            np.floor(before[0] / cell).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        vertices, faces = before[0][first], group.ravel()[before[1]]
    return vertices, drop_flat_faces(vertices, faces)
