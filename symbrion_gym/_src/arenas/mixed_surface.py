"""What rays see of an arena with primitives: these, and the triangles that they do not replace."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import trimesh

from reconstruction._src.surfaces.primitives.find import Primitives
from reconstruction._src.surfaces.primitives.primitive import Primitive

_GEOMS = {
    "plane": mujoco.mjtGeom.mjGEOM_BOX,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
}


def add_primitive(spec: mujoco.MjSpec, name: str, one: Primitive, **options: Any) -> mujoco.MjsGeom:
    """Add a primitive to the world of a spec as a geom."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(one.axes).ravel())
    return spec.worldbody.add_geom(
        name=name, type=_GEOMS[one.kind], pos=one.center, quat=quaternion, size=one.half_sizes, **options
    )


def add_mixed_surface(
    spec: mujoco.MjSpec, surface: trimesh.Trimesh, primitives: Primitives, options: dict[str, Any]
) -> None:
    """Add what rays see: primitives, and the triangles that they do not replace as meshes."""
    for i, one in enumerate(primitives.shapes):
        add_primitive(spec, f"arena_primitive_{i}", one, **options)
    for i, corners in enumerate(_join_small(primitives.find_rest(surface))):
        vertices, index = np.unique(corners.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
        name = f"arena_surface_{i}"
        spec.add_mesh(
            name=name,
            uservert=vertices.astype(np.float64).ravel(),
            userface=index.astype(np.int32).ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        spec.worldbody.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **options)


def _join_small(parts: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return parts that MuJoCo compiles: those of fewer than two triangles join the next."""
    joined: list[np.ndarray] = []
    for part in sorted(parts, key=len):
        if joined and len(joined[-1]) < 2:
            part = np.concatenate([joined.pop(), part])
        joined.append(part)
    return joined
