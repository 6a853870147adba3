"""The part of contact geometry that a robot may meet, for pictures."""

import numpy as np
import trimesh
from jaxtyping import Float, Int

import symbrion_gym as sg
from symbrion_gym._src.contact.distances import compute_depths, find_signed_nearest
from symbrion_gym._src.contact.quality import join_meshes

_PARTS = 80
"""Contact is cut into parts this small, relative to the arena, before those behind the surface are left out."""
_ALIKE = 0.5  # Cosine from which contact faces the same way as the surface
_IN_FRONT = 0.001
"""Contact farther in front of the surface is drawn whichever way it faces [m]. The rest is the outside of a wall."""
_HIDDEN = 1e-4  # Contact deeper inside another piece is left out [m]


def find_touchable(arena: sg.Arena) -> tuple[Float[np.ndarray, "F 3 3"], Int[np.ndarray, " F"]]:
    """Return the triangles of contact that a robot may meet, in small parts, and the piece of each."""
    meshes = [arena.height_field.as_mesh()] if arena.height_field is not None else arena.pieces
    vertices, faces = join_meshes(meshes)
    labels = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    if not len(faces):
        return np.zeros((0, 3, 3)), labels
    size = float(arena.surface.extents.max()) / _PARTS
    parts = trimesh.remesh.subdivide_to_size(vertices, faces, size, max_iter=30, return_index=True)
    faces, origin = (np.asarray(part, dtype=np.int64) for part in parts[1:])
    triangles, labels = np.asarray(parts[0])[faces], labels[origin]
    nearest = find_signed_nearest(triangles.mean(axis=1), arena.surface)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(nearest.normals, axis=1)
    cosines = (normals * nearest.normals).sum(axis=1) / np.maximum(lengths, np.finfo(float).tiny)
    is_front = (nearest.heights > _IN_FRONT) | (cosines > _ALIKE)
    is_front &= compute_depths(triangles.mean(axis=1), arena.pieces) < _HIDDEN
    return triangles[is_front], labels[is_front]
