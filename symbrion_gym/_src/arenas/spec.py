"""An arena as MuJoCo sees it: contact pieces in one geom group, the exact surface in another."""

from typing import NamedTuple

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.halfspaces import Box, find_box
from reconstruction._src.surfaces.primitives.find import Primitives
from symbrion_gym._src.arenas.friction_map import FrictionMap, find_piece_patches
from symbrion_gym._src.arenas.placed_objects import PlacedObject, add_objects
from symbrion_gym._src.arenas.primitives import add_mesh, add_mixed_surface, add_primitive, find_solids
from symbrion_gym._src.arenas.texture import SurfaceTexture, add_texture
from symbrion_gym._src.contact.kinds import FIELD_BASE, HeightField
from symbrion_gym._src.robot.scout_constants import OTHER_FRICTION


class ArenaGeometry(NamedTuple):
    """What of an arena models and files show; see the fields of `Arena`."""

    name: str
    surface: trimesh.Trimesh
    pieces: list[trimesh.Trimesh]
    height_field: HeightField | None
    texture: SurfaceTexture | None
    primitives: Primitives | None
    friction: float
    friction_map: FrictionMap | None
    objects: tuple[PlacedObject, ...]


SURFACE_GROUP = 2  # Geom group of the exact surface: drawn, hit by rays, touched by nothing
CONTACT_GROUP = 3  # Geom group of the contact pieces: touched, not drawn unless asked for
PATCH_PRIORITY = 2
"""Geom priority of pieces in a friction patch: above that of robots, whose friction holds elsewhere."""
SURFACE_COLOR = (0.62, 0.60, 0.56, 1.0)
SURFACE_LOOK = {"contype": 0, "conaffinity": 0, "group": SURFACE_GROUP, "rgba": SURFACE_COLOR}
_GOLDEN_RATIO = 0.61803398875  # Its fractional part: hues this far apart never come near each other
_LEAST_RISE = 1e-3  # MuJoCo wants a height field with some height [m]


def make_arena_spec(geometry: ArenaGeometry, use_files: bool = False) -> mujoco.MjSpec:
    """Return a spec with an arena and lights, nothing else.

    Physics options are left to the caller: `implicitfast`, the Newton solver, a dense Jacobian and a step of 5 ms
    are what the arenas were measured with.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"arena {geometry.name}"
    spec.compiler.degree = False
    for x in (-2.0, 2.0):  # from the side; the near one casts shadows
        spec.worldbody.add_light(
            name=f"arena_light_{'near' if x < 0 else 'far'}",
            pos=[x, -1.5, 3.5],
            dir=[-0.3 * np.sign(x), 0.4, -1.0],
            diffuse=[0.45, 0.45, 0.45],
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            castshadow=x < 0,
        )
    solids, primitives = make_solids(geometry), find_solids(geometry.primitives)
    friction = geometry.friction
    add_solids(spec, spec.worldbody, solids[: len(solids) - len(primitives)], friction, use_files)
    colors = make_piece_colors(len(solids))
    for i, one in enumerate(primitives, len(solids) - len(primitives)):
        look = {"group": CONTACT_GROUP, "rgba": colors[i], "friction": [friction, *OTHER_FRICTION]}
        add_primitive(spec.worldbody, solids[i].name, one.kind, one, **look)
    if geometry.height_field is not None:
        add_height_field(spec, spec.worldbody, geometry.height_field, friction)
    if geometry.primitives is not None:
        add_mixed_surface(spec, geometry.surface, geometry.primitives, SURFACE_LOOK)
    else:
        file = "surface.obj" if use_files else ""
        surface = add_mesh(spec, spec.worldbody, "arena_surface", geometry.surface, file, **SURFACE_LOOK)
        if geometry.texture is not None:
            add_texture(spec, surface, geometry.texture, use_files)
    add_objects(spec, geometry.objects)
    return spec


class Solid(NamedTuple):
    """A convex solid for contact."""

    name: str  # unique, a valid name in all formats
    mesh: trimesh.Trimesh  # its corners and triangles
    box: Box | None  # that it is, where it is one: contacts are several times faster than those of a mesh
    friction: float | None  # sliding friction of the patch that it lies in; None outside of all


def make_solids(geometry: ArenaGeometry, digits: int = 1) -> list[Solid]:
    """Return pieces as solids, whose numbers have at least some digits."""
    frictions: list[float | None] = [None] * len(geometry.pieces)
    if geometry.friction_map is not None:
        values = [*(patch.friction for patch in geometry.friction_map.patches), None]
        frictions = [values[number] for number in find_piece_patches(geometry.pieces, geometry.friction_map)]
    return [
        Solid(f"arena_piece_{i:0{digits}d}", piece, find_box(piece), friction)
        for i, (piece, friction) in enumerate(zip(geometry.pieces, frictions, strict=True))
    ]


def make_piece_colors(count: int) -> Float[np.ndarray, "count 4"]:
    """Return colors (RGBA) that tell neighbors apart: the hue moves on by the golden ratio."""
    hue = (np.arange(count) * _GOLDEN_RATIO) % 1.0
    channel = np.abs(((hue[:, None] + np.array([0.0, 2 / 3, 1 / 3])) % 1.0) * 6.0 - 3.0) - 1.0
    return np.concatenate([0.25 + 0.65 * np.clip(channel, 0.0, 1.0), np.ones((count, 1))], axis=1)


def add_solids(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, solids: list[Solid], friction: float, use_files: bool = False
) -> None:
    """Add contact to a body."""
    for i, (solid, color) in enumerate(zip(solids, make_piece_colors(len(solids)), strict=True)):
        look = {"group": CONTACT_GROUP, "rgba": color, "friction": [friction, *OTHER_FRICTION]}
        if solid.box is None:
            file = f"pieces/{i:03d}.obj" if use_files else ""
            geom = add_mesh(spec, body, solid.name, solid.mesh, file, **look)
        else:
            geom = add_primitive(body, solid.name, "box", solid.box, **look)
        if solid.friction is not None:
            geom.priority, geom.friction[0] = PATCH_PRIORITY, solid.friction


def add_height_field(spec: mujoco.MjSpec, body: mujoco.MjsBody, field: HeightField, friction: float) -> None:
    """Add a height field as contact to a body."""
    lowest, highest = float(field.heights.min()), float(field.heights.max())
    rise = max(highest - lowest, _LEAST_RISE)
    rows, columns = field.heights.shape
    spec.add_hfield(
        name="arena_height_field",
        nrow=rows,
        ncol=columns,
        size=[*((field.high - field.low) / 2), rise, FIELD_BASE],
        userdata=((field.heights - lowest) / rise).ravel(),
    )
    body.add_geom(
        name="arena_height_field",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="arena_height_field",
        pos=[*((field.high + field.low) / 2), lowest],
        group=CONTACT_GROUP,
        friction=[friction, *OTHER_FRICTION],
    )
