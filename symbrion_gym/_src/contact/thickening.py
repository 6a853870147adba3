"""From a surface to solids behind it: how thick they may be, and where their inner vertices lie."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float, Int

from symbrion_gym._src.contact.ray_mesh import RayMesh

_LEAST_DIRECTION = 0.5
"""Unit vectors are longer; the normal of a flat face is not."""


@dataclass(frozen=True)
class ThicknessConfig:
    """How thick the solid behind a surface is.

    Attributes:
        thickness: of the solid where nothing lies behind it [m]: more than a robot sinks in during a few
            steps; beams that pass a boundary of the surface meet the sides of thicker ones.
        share: of the distance to whatever surface lies behind, where that is nearer: a thin wall stays a wall.
        least: thinner solids are flat to a simulator [m].
        start: a ray into the solid begins this far behind the surface [m].
        min_cosine: an inner vertex lies behind every face of its vertex: where the normals at a vertex differ by more
            than the angle of this cosine, each face has inner vertices of its own.
        largest: a solid is no thicker than this share of the extent of the surface.
        two_sided: of the solid behind faces that were seen from behind, too [m]: a sheet that stands for both sides of
            a thin wall; a robot sinks in less than this.
    """

    thickness: float = 0.03
    share: float = 0.9
    least: float = 0.004
    start: float = 5e-4
    min_cosine: float = 0.3
    largest: float = 0.05
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


def find_thickness(
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
