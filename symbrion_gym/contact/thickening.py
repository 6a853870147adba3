"""From a surface to solids behind it: how thick they may be, and where their inner vertices lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int


_LEAST_DIRECTION = 0.5
"""Unit vectors are longer; the normal of a flat face is not."""


@dataclass(frozen=True)
class ThicknessConfig:
    """How thick the solid behind a surface is.

    Attributes:
        thickness: of the solid where nothing lies behind it [m]: more than a robot sinks in during a few steps.
        share: of the distance to whatever surface lies behind, where that is nearer: a thin wall stays a wall.
        least: thinner solids are flat to a simulator [m].
        start: a ray into the solid begins this far behind the surface [m].
        min_cosine: an inner vertex lies behind every face of its vertex: where the normals at a vertex differ by more
            than the angle of this cosine, each face has inner vertices of its own.
    """

    thickness: float = 0.06
    share: float = 0.9
    least: float = 0.004
    start: float = 5e-4
    min_cosine: float = 0.3


THICKNESS_DEFAULTS = ThicknessConfig()


def find_depths(
    mesh: trimesh.Trimesh, surface: trimesh.Trimesh, config: ThicknessConfig = THICKNESS_DEFAULTS
) -> Float[np.ndarray, " V"]:
    """Return how thick the solid behind each vertex may be: up to the other side of a thin wall [m].

    Args:
        mesh: what is thickened, wound so that its faces look at free space.
        surface: what solids may not pierce.
        config: how thick solids are.
    """
    corners = np.asarray(mesh.triangles)
    normals = np.asarray(mesh.face_normals)
    vertex_normals = np.asarray(mesh.vertex_normals)
    count = len(mesh.faces)
    places = np.concatenate([corners.mean(axis=1), *((corners[:, k] + corners[:, k - 2]) / 2 for k in range(3))])
    starts = np.concatenate([places, mesh.vertices])
    inwards = -np.concatenate([np.tile(normals, (4, 1)), vertex_normals])
    reach = cast_rays(surface, starts + config.start * inwards, inwards) + config.start
    allowed = np.clip(config.share * reach, config.least, config.thickness)
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


def cast_rays(
    surface: trimesh.Trimesh, starts: Float[np.ndarray, "N 3"], directions: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, " N"]:
    """Return how far rays get before they hit either side of a surface [m]; inf where they do not."""
    import mujoco

    spec = mujoco.MjSpec()
    center = np.asarray(surface.bounds).mean(axis=0)
    spec.add_mesh(
        name="surface",
        uservert=(np.asarray(surface.vertices, dtype=np.float64) - center).ravel(),
        userface=np.asarray(surface.faces, dtype=np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="surface")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geom = np.zeros(1, dtype=np.int32)
    lengths = np.full(len(starts), -1.0)
    for i in np.flatnonzero(np.linalg.norm(directions, axis=1) > _LEAST_DIRECTION):
        start, direction = starts[i] - center, directions[i]
        lengths[i] = mujoco.mj_ray(model, data, start, direction, None, 1, -1, geom)
    return np.where(lengths < 0, np.inf, lengths)
