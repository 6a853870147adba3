"""An arena as MuJoCo sees it: contact pieces in one geom group, the exact surface in another."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.halfspaces import find_box
from reconstruction._src.surfaces.primitives.find import Primitives
from symbrion_gym._src.arenas.friction_map import FrictionMap, find_piece_patches
from symbrion_gym._src.arenas.primitives import add_mixed_surface, add_primitive, find_solids
from symbrion_gym._src.arenas.texture import SurfaceTexture, add_texture
from symbrion_gym._src.contact.kinds import HeightField


class ArenaGeometry(NamedTuple):
    """The shapes of an arena."""

    surface: trimesh.Trimesh  # the exact surface, for rays and pictures
    pieces: list[trimesh.Trimesh]  # convex solids, for contact
    height_field: HeightField | None  # in place of pieces, for the kind "hfield"
    texture: SurfaceTexture | None = None  # colors of the surface; None where they are unknown
    # in place of triangles, for the kind "mixed"; the solid ones are the last pieces
    primitives: Primitives | None = None


SURFACE_GROUP = 2  # Geom group of the exact surface: drawn, hit by rays, touched by nothing
CONTACT_GROUP = 3  # Geom group of the contact pieces: touched, not drawn unless asked for

PATCH_PRIORITY = 2
"""Geom priority of pieces in a friction patch: above that of robots, whose friction holds elsewhere."""
ROLLING_FRICTION = (0.005, 0.0001)  # Torsional [m] and rolling [m] friction: MuJoCo's defaults
SURFACE_COLOR = (0.62, 0.60, 0.56, 1.0)
_GOLDEN_RATIO = 0.61803398875  # Its fractional part: hues this far apart never come near each other
LEAST_RISE = 1e-3  # MuJoCo wants a height field with some height [m]
FIELD_BASE = 0.2  # How far a height field reaches below its lowest point [m]


def make_arena_spec(
    name: str,
    geometry: ArenaGeometry,
    friction: float,
    use_files: bool = False,
    friction_map: FrictionMap | None = None,
) -> mujoco.MjSpec:
    """Return a spec with an arena and lights, nothing else.

    Physics options are left to the caller: `implicitfast`, the Newton solver, a dense Jacobian and a step of 5 ms
    are what the arenas were measured with.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"arena {name}"
    spec.compiler.degree = False
    _add_lights(spec)
    colors, solids = make_piece_colors(len(geometry.pieces)), find_solids(geometry.primitives)
    patch_frictions = compute_patch_frictions(geometry.pieces, friction_map)
    for i, piece in enumerate(geometry.pieces):
        file = f"pieces/{i:03d}.obj" if use_files else ""
        name, own = f"arena_piece_{i}", patch_frictions[i]
        if i >= len(geometry.pieces) - len(solids):
            solid, options = solids[i - len(geometry.pieces)], {"friction": [friction, *ROLLING_FRICTION]}
            add_primitive(spec, name, solid, group=CONTACT_GROUP, rgba=colors[i], **options)
            continue
        geom = _add_piece(spec, name, piece, friction, colors[i], file)
        if own is not None:
            geom.priority, geom.friction[0] = PATCH_PRIORITY, own
    if geometry.height_field is not None:
        _add_height_field(spec, geometry.height_field, friction)
    seen = {"contype": 0, "conaffinity": 0, "group": SURFACE_GROUP, "rgba": SURFACE_COLOR}
    if geometry.primitives is not None:
        add_mixed_surface(spec, geometry.surface, geometry.primitives, seen)
        return spec
    _add_mesh(spec, "arena_surface", geometry.surface, "surface.obj" if use_files else "")
    surface = spec.worldbody.add_geom(
        name="arena_surface",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname="arena_surface",
        **seen,
    )
    if geometry.texture is not None:
        add_texture(spec, surface, geometry.texture, use_files)
    return spec


def _add_lights(spec: mujoco.MjSpec) -> None:
    """Add two lights from the side; the near one casts shadows."""
    for x in (-2.0, 2.0):
        spec.worldbody.add_light(
            name=f"arena_light_{'near' if x < 0 else 'far'}",
            pos=[x, -1.5, 3.5],
            dir=[-0.3 * np.sign(x), 0.4, -1.0],
            diffuse=[0.45, 0.45, 0.45],
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            castshadow=x < 0,
        )


def compute_patch_frictions(
    pieces: list[trimesh.Trimesh], friction_map: FrictionMap | None
) -> list[float | None]:
    """Return the friction of each of the pieces that lie in a patch; None for the others."""
    if friction_map is None:
        return [None] * len(pieces)
    numbers = find_piece_patches(pieces, friction_map)
    return [None if number < 0 else friction_map.patches[number].friction for number in numbers]


def make_piece_colors(count: int) -> Float[np.ndarray, "count 4"]:
    """Return colors (RGBA) that tell neighbors apart: the hue moves on by the golden ratio."""
    hue = (np.arange(count) * _GOLDEN_RATIO) % 1.0
    channel = np.abs(((hue[:, None] + np.array([0.0, 2 / 3, 1 / 3])) % 1.0) * 6.0 - 3.0) - 1.0
    return np.concatenate([0.25 + 0.65 * np.clip(channel, 0.0, 1.0), np.ones((count, 1))], axis=1)


def _add_piece(
    spec: mujoco.MjSpec,
    name: str,
    piece: trimesh.Trimesh,
    friction: float,
    rgba: Float[np.ndarray, " 4"],
    file: str,
) -> mujoco.MjsGeom:
    """Add a contact piece: as a box where it is one, which makes contacts several times faster than a mesh."""
    box = find_box(piece)
    geom = spec.worldbody.add_geom(
        name=name, group=CONTACT_GROUP, rgba=rgba, friction=[friction, *ROLLING_FRICTION]
    )
    if box is None:
        _add_mesh(spec, name, piece, file)
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, name
        return geom
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, box.axes.ravel())
    geom.type, geom.pos = mujoco.mjtGeom.mjGEOM_BOX, box.center
    geom.size, geom.quat = box.half_sizes, quaternion
    return geom


def _add_height_field(spec: mujoco.MjSpec, field: HeightField, friction: float) -> None:
    lowest, highest = float(field.heights.min()), float(field.heights.max())
    rise = max(highest - lowest, LEAST_RISE)
    rows, columns = field.heights.shape
    spec.add_hfield(
        name="arena_height_field",
        nrow=rows,
        ncol=columns,
        size=[*((field.high - field.low) / 2), rise, FIELD_BASE],
        userdata=((field.heights - lowest) / rise).ravel(),
    )
    spec.worldbody.add_geom(
        name="arena_height_field",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="arena_height_field",
        pos=[*((field.high + field.low) / 2), lowest],
        group=CONTACT_GROUP,
        friction=[friction, *ROLLING_FRICTION],
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
