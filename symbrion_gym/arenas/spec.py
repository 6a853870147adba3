"""An arena as MuJoCo sees it: contact pieces in one geom group, the exact surface in another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
import trimesh

from symbrion_gym.contact.kinds import HeightField

if TYPE_CHECKING:
    from symbrion_gym.arenas.arena import Arena

SURFACE_GROUP = 2
"""Geom group of the exact surface: drawn, hit by rays, touched by nothing."""
CONTACT_GROUP = 3
"""Geom group of the contact pieces: touched, not drawn unless asked for."""

_ROLLING_FRICTION = (0.005, 0.0001)
"""Torsional [m] and rolling [m] friction: MuJoCo's defaults."""
_SURFACE_COLOR = (0.62, 0.60, 0.56, 1.0)


def make_arena_spec(arena: Arena, use_files: bool = False) -> mujoco.MjSpec:
    """Return a spec with the arena and lights, nothing else.

    It compiles without any file, unless `use_files`: then meshes are named as in a saved arena's folder.

    Physics options are left to the caller: `implicitfast`, the Newton
    solver, a dense Jacobian and a step of 5 ms are what the arenas were measured with.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"arena {arena.name}"
    spec.compiler.degree = False
    for x in (-2.0, 2.0):
        spec.worldbody.add_light(
            name=f"arena_light_{'near' if x < 0 else 'far'}",
            pos=[x, -1.5, 3.5],
            dir=[-0.3 * np.sign(x), 0.4, -1.0],
            diffuse=[0.45, 0.45, 0.45],
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            castshadow=x < 0,
        )
    colors = make_piece_colors(len(arena.pieces))
    for i, piece in enumerate(arena.pieces):
        file = f"pieces/{i:03d}.obj" if use_files else ""
        _add_piece(spec, f"arena_piece_{i}", piece, arena.friction, colors[i], file)
    if arena.height_field is not None:
        _add_height_field(spec, arena.height_field, arena.friction)
    _add_mesh(spec, "arena_surface", arena.surface, "surface.obj" if use_files else "")
    spec.worldbody.add_geom(
        name="arena_surface",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname="arena_surface",
        contype=0,
        conaffinity=0,
        group=SURFACE_GROUP,
        rgba=_SURFACE_COLOR,
    )
    return spec


def make_piece_colors(count: int) -> np.ndarray:
    """Return colours that tell neighbours apart, `[count, 4]`: the hue walks by the golden ratio."""
    hue = (np.arange(count) * 0.61803398875) % 1.0
    channel = np.abs(((hue[:, None] + np.array([0.0, 2 / 3, 1 / 3])) % 1.0) * 6.0 - 3.0) - 1.0
    return np.concatenate([0.25 + 0.65 * np.clip(channel, 0.0, 1.0), np.ones((count, 1))], axis=1)


def find_box(piece: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return centre `[3]`, half sizes `[3]` and axes (columns) `[3, 3]` where a piece is a box, else None.

    A box touches several times faster than a mesh of the same shape.
    """
    corners = np.asarray(piece.vertices, dtype=np.float64)
    if len(corners) != 8:
        return None
    center = corners.mean(axis=0)
    edges = corners[1:] - corners[0]
    edges = edges[np.argsort(np.linalg.norm(edges, axis=1))]
    axes = [edges[0]]
    for edge in edges[1:]:
        if len(axes) < 3 and all(abs(edge @ axis) <= 1e-5 * np.linalg.norm(edge) for axis in axes):
            axes.append(edge)
    if len(axes) < 3:
        return None
    sizes = np.linalg.norm(axes, axis=1)
    frame = (np.array(axes) / sizes[:, None]).T
    if np.linalg.det(frame) < 0:
        frame[:, 2] *= -1.0
    if not np.allclose(np.abs((corners - center) @ frame), sizes / 2, atol=5e-6):
        return None
    return center, sizes / 2, frame


def _add_piece(
    spec: mujoco.MjSpec, name: str, piece: trimesh.Trimesh, friction: float, rgba: np.ndarray, file: str
) -> None:
    box = find_box(piece)
    geom = spec.worldbody.add_geom(
        name=name, group=CONTACT_GROUP, rgba=rgba, friction=[friction, *_ROLLING_FRICTION]
    )
    if box is None:
        _add_mesh(spec, name, piece, file)
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, name
        return
    center, half_sizes, frame = box
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, frame.ravel())
    geom.type, geom.pos, geom.size, geom.quat = mujoco.mjtGeom.mjGEOM_BOX, center, half_sizes, quaternion


def _add_height_field(spec: mujoco.MjSpec, field: HeightField, friction: float) -> None:
    lowest, highest = float(field.heights.min()), float(field.heights.max())
    rise = max(highest - lowest, 1e-3)
    rows, columns = field.heights.shape
    spec.add_hfield(
        name="arena_height_field",
        nrow=rows,
        ncol=columns,
        size=[*((field.high - field.low) / 2), rise, 0.2],
        userdata=((field.heights - lowest) / rise).ravel(),
    )
    spec.worldbody.add_geom(
        name="arena_height_field",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="arena_height_field",
        pos=[*((field.high + field.low) / 2), lowest],
        group=CONTACT_GROUP,
        friction=[friction, *_ROLLING_FRICTION],
    )


def _add_mesh(spec: mujoco.MjSpec, name: str, mesh: trimesh.Trimesh, file: str) -> None:
    if file:
        spec.add_mesh(name=name, file=file, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        return
    spec.add_mesh(
        name=name,
        uservert=np.asarray(mesh.vertices, dtype=np.float64).ravel(),
        userface=np.asarray(mesh.faces, dtype=np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
