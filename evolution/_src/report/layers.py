"""What lies over the surface in pictures of an arena: friction, and the contact that a robot may meet."""

import numpy as np
import trimesh
from jaxtyping import Int
from matplotlib.patches import Patch

import symbrion_gym as sg
from evolution._src.report.raster import Picture, Pixels, Triangles, View, blend
from symbrion_gym._src.contact.distances import compute_depths, find_signed_nearest
from symbrion_gym._src.contact.quality import join_meshes

SLIPPERY, ROUGH = (0.20, 0.50, 0.95), (0.75, 0.40, 0.15)
"""Colors of patches with less and with more friction than the rest of the ground."""
_FULL = 0.5  # Difference of the friction that is drawn in the full color
_OPACITY = (0.25, 0.8)  # Of the smallest and of the largest difference


def add_friction(picture: Picture, surface: Pixels, view: View, arena: sg.Arena) -> Picture:
    """Return the picture with friction patches tinted."""
    found = arena.friction_map
    if found is None or not found.patches:
        return picture
    rows, columns = np.nonzero(np.isfinite(surface.height) & (surface.face >= 0))
    numbers = found.find_patches(view.find_points(columns, rows, surface.height[rows, columns]))
    for number, patch in enumerate(found.patches):
        is_own = np.zeros(surface.face.shape, dtype=bool)
        is_own[rows[numbers == number], columns[numbers == number]] = True
        color, opacity = _find_look(patch.friction, arena.friction)
        picture = blend(picture, np.broadcast_to(np.array(color), picture.shape), is_own, opacity)
    return picture


def make_friction_legend(arena: sg.Arena) -> list[Patch]:
    """Return an entry for each patch."""
    if arena.friction_map is None:
        return []
    entries = []
    for patch in arena.friction_map.patches:
        color, opacity = _find_look(patch.friction, arena.friction)
        interval = f" ± {patch.half_width:.2f}" if patch.half_width else ""
        entries.append(Patch(color=color, alpha=opacity, label=f"friction {patch.friction:.2f}{interval}"))
    return entries


def _find_look(friction: float, usual: float) -> tuple[tuple[float, float, float], float]:
    share = min(abs(friction - usual) / _FULL, 1.0)
    return (SLIPPERY if friction < usual else ROUGH), _OPACITY[0] + share * (_OPACITY[1] - _OPACITY[0])


_PARTS = 80
"""Contact is cut into parts this small, relative to the arena, before those behind the surface are left out."""
_ALIKE = 0.5  # Cosine from which contact faces the same way as the surface
_IN_FRONT = 0.001
"""Contact farther in front of the surface is drawn whichever way it faces [m]. The rest is the outside of a wall."""
_HIDDEN = 1e-4  # Contact deeper inside another piece is left out [m]


def find_touchable(arena: sg.Arena) -> tuple[Triangles, Int[np.ndarray, " F"]]:
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
