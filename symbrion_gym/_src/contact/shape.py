"""What kind of surface it is: open terrain, an open surface with overhangs, or a closed body."""

from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Bool, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.sampling import sample_grid

Shape = Literal["terrain", "overhang", "closed"]

_MAX_OVERHANG = 0.03  # Share of the area that may lie beneath other ground in a terrain: folds of a noisy map
_MIN_GROUND = 0.05  # Share of the area that a terrain has in plan, at least; less is nothing but walls
_WALL_RISE = 0.3  # Faces whose normal rises less are walls, not hidden ground
_HIDDEN_DEPTH = 0.01  # Ground this far beneath other ground is hidden, relative to the extent
_BLOCK_POINTS = 120  # Points a side of the grid on which a closed body is compared with a block
_BLOCK_ERROR = 0.05  # Share of its volume by which a block may differ from the space beneath its top
_UNDERSIDE = 1e-3  # Faces this close to the lowest level belong to the underside, relative to the height
_SIDE_RISE = 0.05  # Faces whose normal rises less, and that reach the lowest level, are the sides of a block
_TOP_RISE = -0.2  # Faces whose normal rises less look down: they are no part of the top
_MAX_FANS = 0.02
"""Area of the fans that close holes, relative to the mesh: a tube shorter than 50 radii stays open."""


def find_shape(mesh: trimesh.Trimesh, elevation: Elevation) -> Shape:
    """Tell a terrain (seen whole from above) from an open surface with overhangs and from a closed body.

    A closed body that is a terrain with a flat underside counts as terrain.
    """
    areas, rises = mesh.area_faces, mesh.face_normals[:, 2]
    if float(areas @ np.abs(rises)) < _MIN_GROUND * float(areas.sum()):
        return "overhang"  # nothing but walls: there is no ground to follow
    if not mesh.is_watertight:
        hidden = _measure_hidden(mesh, elevation)
        return "terrain" if hidden <= _MAX_OVERHANG else "overhang"
    return "terrain" if _is_block(mesh, elevation) else "closed"


def take_top(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the part of a mesh that is ground or wall, without an underside."""
    is_top = mesh.face_normals[:, 2] > _TOP_RISE
    if mesh.is_watertight:
        is_top &= ~_find_underside(mesh)
    top = trimesh.Trimesh(mesh.vertices, mesh.faces[is_top], process=False)
    top.remove_unreferenced_vertices()
    return top


def close_holes(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the mesh with a fan in every hole, if the holes are small against the mesh."""
    rim = find_rim(mesh)
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
    return closed if closed.area <= (1.0 + _MAX_FANS) * mesh.area else mesh


def find_rim(mesh: trimesh.Trimesh) -> Int[np.ndarray, "E 2"]:
    """Return the edges with one face, as that face runs along them."""
    edges = np.asarray(mesh.faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, first, number = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[number == 1]]


def _measure_hidden(mesh: trimesh.Trimesh, elevation: Elevation) -> float:
    """Return the share of the area that has something else above it; walls do not count."""
    areas, centers = mesh.area_faces, mesh.triangles_center
    above = elevation.height(centers[:, 0], centers[:, 1]) - centers[:, 2]
    is_ground = np.abs(mesh.face_normals[:, 2]) > _WALL_RISE
    is_hidden = is_ground & (above > _HIDDEN_DEPTH * float(mesh.extents.max()))
    return float(areas[is_hidden].sum() / areas.sum())


def _is_block(mesh: trimesh.Trimesh, elevation: Elevation) -> bool:
    """Return whether all between the top, seen from above, and the lowest level is filled."""
    low, high = mesh.bounds
    step = float(np.prod((high - low)[:2] / (_BLOCK_POINTS - 1)))
    points = sample_grid(np.asarray(mesh.bounds), _BLOCK_POINTS, margin=0.0)
    heights = elevation.height(*points.T)
    filled = float(np.nansum(heights - low[2])) * step
    return filled > 0 and bool(abs(mesh.volume / filled - 1.0) < _BLOCK_ERROR)


def _find_underside(mesh: trimesh.Trimesh) -> Bool[np.ndarray, " F"]:
    """Return which faces lie at the lowest level, or are vertical and reach down to it."""
    level = mesh.bounds[0, 2] + _UNDERSIDE * np.ptp(mesh.bounds[:, 2])
    is_low = mesh.triangles[:, :, 2] < level
    is_side = np.abs(mesh.face_normals[:, 2]) < _SIDE_RISE
    return is_low.all(axis=1) | (is_low.any(axis=1) & is_side)
