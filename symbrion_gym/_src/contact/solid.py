"""From an open surface to a closed solid, and what kind of surface it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.sampling import sample_grid
from symbrion_gym._src.contact.quality import RayMesh

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


def close_downwards(mesh: trimesh.Trimesh, thickness: float) -> trimesh.Trimesh:
    """Return a solid: the surface, walls down from its boundary loops, and a copy of it below, flat."""
    bottom = float(mesh.vertices[:, 2].min()) - thickness
    below = np.array(mesh.vertices)
    below[:, 2] = bottom
    return _stitch(mesh, below)


def thicken(mesh: trimesh.Trimesh, thickness: float) -> trimesh.Trimesh:
    """Return a solid: the surface, and a copy of it moved against its normals by `thickness` [m]."""
    return _stitch(mesh, mesh.vertices - thickness * mesh.vertex_normals)


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


def _stitch(mesh: trimesh.Trimesh, other_side: Float[np.ndarray, "V 3"]) -> trimesh.Trimesh:
    """Return a mesh, turned-over faces on its other side, and a band between their rims."""
    count = len(mesh.vertices)
    rim = find_rim(mesh)
    near = np.stack([rim[:, 1], rim[:, 0], rim[:, 0] + count], axis=1)
    far = np.stack([rim[:, 1], rim[:, 0] + count, rim[:, 1] + count], axis=1)
    faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1] + count, near, far])
    return trimesh.Trimesh(np.concatenate([mesh.vertices, other_side]), faces, process=False)


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


_LEAST_DIRECTION = 0.5  # Unit vectors are longer; the normal of a flat face is not


@dataclass(frozen=True)
class ThicknessConfig:
    """How thick the solid behind a surface is."""

    # of the solid where nothing lies behind it [m]: more than a robot sinks in during a few steps; beams that
    # pass a boundary of the surface meet the sides of thicker ones
    thickness: float = 0.03
    # of the distance to whatever surface lies behind, where that is nearer: a thin wall stays a wall
    share: float = 0.9
    least: float = 0.004  # thinner solids are flat to a simulator [m]
    start: float = 5e-4  # a ray into the solid begins this far behind the surface [m]
    # an inner vertex lies behind every face of its vertex: where the normals at a vertex differ by more than
    # the angle of this cosine, each face has inner vertices of its own
    min_cosine: float = 0.3
    largest: float = 0.05  # a solid is no thicker than this share of the extent of the surface
    # of the solid behind faces that were seen from behind, too [m]: a sheet that stands for both sides of a
    # thin wall; a robot sinks in less than this
    two_sided: float = 0.01

    def scale_to(self, extent: float) -> ThicknessConfig:
        """Return this, thinner where the extent of a surface is small [m]."""
        scale = min(1.0, self.largest * extent / self.thickness)
        return replace(
            self,
            thickness=scale * self.thickness,
            least=scale * self.least,
            start=scale * self.start,
            two_sided=scale * self.two_sided,
        )


THICKNESS_DEFAULTS = ThicknessConfig()


def compute_thickness(
    mesh: trimesh.Trimesh,
    find_limits: Callable[[Float[np.ndarray, "N 3"]], Float[np.ndarray, " N"]] | None = None,
    config: ThicknessConfig = THICKNESS_DEFAULTS,
) -> Float[np.ndarray, " V"]:
    """Return how thick the solid behind each vertex may be: up to the other side of a thin wall [m]."""
    corners = np.asarray(mesh.triangles)
    normals = np.asarray(mesh.face_normals)
    vertex_normals = np.asarray(mesh.vertex_normals)
    count = len(mesh.faces)
    places = np.concatenate(
        [corners.mean(axis=1), *((corners[:, k] + corners[:, k - 2]) / 2 for k in range(3))]
    )
    starts = np.concatenate([places, mesh.vertices])
    inwards = -np.concatenate([np.tile(normals, (4, 1)), vertex_normals])
    has_direction = np.linalg.norm(inwards, axis=1) > _LEAST_DIRECTION
    reach = np.full(len(starts), np.inf)
    rays = RayMesh([mesh])
    reach[has_direction] = rays.cast((starts + config.start * inwards)[has_direction], inwards[has_direction])
    allowed = np.clip(config.share * (reach + config.start), config.least, config.thickness)
    if find_limits is not None:
        allowed = np.minimum(allowed, find_limits(starts))
    faces = allowed[: 4 * count].reshape(4, count).min(axis=0)
    depths = allowed[4 * count :]
    for k in range(3):
        np.minimum.at(depths, np.asarray(mesh.faces)[:, k], faces)
    return depths


def find_inner_points(
    mesh: trimesh.Trimesh,
    faces: Int[np.ndarray, " M"],
    depths: Float[np.ndarray, " V"],
    config: ThicknessConfig = THICKNESS_DEFAULTS,
) -> Float[np.ndarray, "N 3"]:
    """Return points behind some faces of a mesh, at the depth of each vertex."""
    corners = np.asarray(mesh.faces)[faces]
    directions = np.asarray(mesh.vertex_normals)[corners]
    normals = np.asarray(mesh.face_normals)[faces][:, None]
    cosines = np.einsum("fki,fki->fk", directions, np.broadcast_to(normals, directions.shape))
    directions = np.where(cosines[..., None] < config.min_cosine, normals, directions)
    inner = np.asarray(mesh.vertices)[corners] - depths[corners][..., None] * directions
    return np.unique(inner.reshape(-1, 3), axis=0)
