"""From an open surface to a closed solid, and what kind of surface it is."""

from __future__ import annotations

from typing import Literal

import numpy as np
import trimesh
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from reconstruction.geometry.elevation import Elevation
from symbrion_gym.contact.mesh_repair import decimate

Shape = Literal["terrain", "overhang", "closed"]

_MAX_OVERHANG = 0.03
"""Share of the area that may lie beneath other ground in a terrain: folds of a noisy map."""


def find_shape(mesh: trimesh.Trimesh) -> Shape:
    """Tell a terrain (seen whole from above) from an open surface with overhangs and from a closed body.

    A closed body that is a terrain with a flat underside counts as terrain.
    """
    areas, rises = mesh.area_faces, mesh.face_normals[:, 2]
    if float(areas @ np.abs(rises)) < 0.05 * float(areas.sum()):
        return "overhang"  # nothing but walls: there is no ground to follow
    if not mesh.is_watertight:
        return "terrain" if _measure_hidden(mesh) <= _MAX_OVERHANG else "overhang"
    return "terrain" if _is_block(mesh) else "closed"


def take_top(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the part of a mesh that is ground or wall, without an underside."""
    is_top = mesh.face_normals[:, 2] > -0.2
    if mesh.is_watertight:
        is_top &= ~_find_underside(mesh)
    top = trimesh.Trimesh(mesh.vertices, mesh.faces[is_top], process=False)
    top.remove_unreferenced_vertices()
    return top


def close_downwards(mesh: trimesh.Trimesh, thickness: float) -> trimesh.Trimesh:
    """Return a solid: the surface, walls down from its boundary loops, and a copy of it below, flat.

    Args:
        mesh: open terrain, normals up.
        thickness: how far the underside lies below the lowest point [m].
    """
    bottom = float(mesh.vertices[:, 2].min()) - thickness
    below = np.array(mesh.vertices)
    below[:, 2] = bottom
    return _stitch(mesh, below)


def thicken(mesh: trimesh.Trimesh, thickness: float) -> trimesh.Trimesh:
    """Return a solid: the surface, and a copy of it moved against its normals by `thickness` [m]."""
    return _stitch(mesh, mesh.vertices - thickness * mesh.vertex_normals)


def simplify_solid(solid: trimesh.Trimesh, num_faces: int = 400) -> trimesh.Trimesh:
    """Return the solid with about `num_faces` faces, or as it was where that would wreck it."""
    simple = trimesh.Trimesh(*decimate(solid.vertices, solid.faces, num_faces), process=False)
    is_sound = simple.is_watertight and abs(simple.volume / max(solid.volume, 1e-12) - 1.0) < 0.02
    return simple if is_sound else solid


def close_holes(mesh: trimesh.Trimesh, max_share: float = 0.02) -> trimesh.Trimesh:
    """Return the mesh with a fan in every hole, if the holes are small against the mesh.

    Args:
        mesh: a body with holes where it was not seen.
        max_share: area of all fans, relative to that of the mesh: a tube shorter than 50 radii stays open.
    """
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, first, number = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    rim = edges[first[number == 1]]
    if not len(rim):
        return mesh
    count = len(mesh.vertices)
    links = csr_matrix((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(count, count))
    _, loop = connected_components(links, directed=False)
    loops, number = np.unique(loop[rim[:, 0]], return_inverse=True)
    middles = np.zeros((len(loops), 3))
    np.add.at(middles, number, mesh.vertices[rim[:, 0]])
    middles /= np.bincount(number)[:, None]
    fans = np.column_stack([rim[:, 1], rim[:, 0], count + number])
    vertices, faces = np.concatenate([mesh.vertices, middles]), np.concatenate([mesh.faces, fans])
    closed = trimesh.Trimesh(vertices, faces, process=False)
    return closed if closed.area <= (1.0 + max_share) * mesh.area else mesh


def _stitch(mesh: trimesh.Trimesh, other_side: np.ndarray) -> trimesh.Trimesh:
    count = len(mesh.vertices)
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, first, number = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    rim = edges[first[number == 1]]
    near = np.stack([rim[:, 1], rim[:, 0], rim[:, 0] + count], axis=1)
    far = np.stack([rim[:, 1], rim[:, 0] + count, rim[:, 1] + count], axis=1)
    faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1] + count, near, far])
    return trimesh.Trimesh(np.concatenate([mesh.vertices, other_side]), faces, process=False)


def _measure_hidden(mesh: trimesh.Trimesh) -> float:
    """Share of the area that has something else more than 1 % of the extent above it; walls do not count."""
    areas, centers = mesh.area_faces, mesh.triangles_center
    above = Elevation(mesh).height(centers[:, 0], centers[:, 1]) - centers[:, 2]
    is_hidden = (np.abs(mesh.face_normals[:, 2]) > 0.3) & (above > 0.01 * float(mesh.extents.max()))
    return float(areas[is_hidden].sum() / areas.sum())


def _is_block(mesh: trimesh.Trimesh) -> bool:
    """Whether all between the top, seen from above, and the lowest level is filled."""
    low, high = mesh.bounds
    axes = [np.linspace(low[i], high[i], 120) for i in range(2)]
    step = float(np.prod([axis[1] - axis[0] for axis in axes]))
    x, y = (axis.ravel() for axis in np.meshgrid(*axes))
    heights = Elevation(mesh).height(x, y)
    filled = float(np.nansum(heights - low[2])) * step
    return filled > 0 and bool(abs(mesh.volume / filled - 1.0) < 0.05)


def _find_underside(mesh: trimesh.Trimesh) -> np.ndarray:
    """Faces at the lowest level, and vertical ones that reach down to it."""
    level = mesh.bounds[0, 2] + 1e-3 * np.ptp(mesh.bounds[:, 2])
    is_low = mesh.triangles[:, :, 2] < level
    return is_low.all(axis=1) | (is_low.any(axis=1) & (np.abs(mesh.face_normals[:, 2]) < 0.05))
