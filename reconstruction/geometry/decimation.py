"""Meshes with fewer faces."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from reconstruction.geometry.mesh_cleaning import drop_flat_faces, merge_vertices

_OVERSHOOT = 0.02
"""Quadric decimation may leave the bounds of the mesh by this share of the extent; beyond, it has gone wrong."""


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
    """Return about `count` faces by quadric decimation, or by clustering vertices where that wrecks the mesh.

    Raises:
        ReconstructionError: no face with an area is left.
    """
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
