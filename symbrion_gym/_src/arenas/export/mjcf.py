"""MJCF: one file that MuJoCo loads without this package, and that other models include or attach.

The vertices stand in the file: no path breaks when another model includes it, and 2,000 pieces load faster than from
2,000 files.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
from jaxtyping import Num

from symbrion_gym._src.arenas.export.content import Content, Solid
from symbrion_gym._src.arenas.placed_objects import OBJECT_COLOR, OBJECT_GROUP, PlacedObject, name_objects
from symbrion_gym._src.arenas.spec import (
    CONTACT_GROUP,
    FIELD_BASE,
    LEAST_RISE,
    PATCH_PRIORITY,
    ROLLING_FRICTION,
    SURFACE_COLOR,
    SURFACE_GROUP,
    make_piece_colors,
)
from symbrion_gym._src.arenas.texture import TEXTURE_FILE, to_png
from symbrion_gym._src.contact.kinds import HeightField

BODY = "arena"  # Name of the body that holds all geoms
_DIGITS = 6  # Coordinates to 1 µm, as in a saved arena
_UV_DIGITS = 12  # Of places in a texture: fractions of powers of two


def format_mjcf(content: Content) -> dict[str, bytes]:
    """Return `arena.xml` with contact and surface, and `contact.xml` without the surface."""
    models = {
        "arena.xml": _format_model(content, has_surface=True),
        "contact.xml": _format_model(content, has_surface=False),
    }
    return models if content.texture is None else models | {TEXTURE_FILE: to_png(content.texture.image)}


def _format_model(content: Content, *, has_surface: bool) -> bytes:
    assets, geoms = list(_format_assets(content)), list(_format_geoms(content))
    if has_surface:
        assets += _format_surface(content)
        look = f'rgba="{_join(SURFACE_COLOR)}"' if content.texture is None else 'material="arena_surface"'
        geoms.append(
            f'<geom name="arena_surface" type="mesh" mesh="arena_surface" contype="0" conaffinity="0" '
            f'group="{SURFACE_GROUP}" mass="0" {look}/>'
        )
        for name, each in name_objects(content.objects).items():
            mesh_faces = " ".join(map(str, np.asarray(each.mesh.faces).ravel().tolist()))
            vertices = _join(np.asarray(each.mesh.vertices))
            assets.append(f'<mesh name="{name}" inertia="shell" vertex="{vertices}" face="{mesh_faces}"/>')
            geoms += _format_object(name, each)
    lines = [
        f"<mujoco model={quoteattr('arena ' + content.name)}>",
        "<asset>",
        *assets,
        "</asset>",
        "<worldbody>",
        f'<body name="{BODY}">',
        *geoms,
        "</body>",
        "</worldbody>",
        "</mujoco>",
    ]
    return ("\n".join(lines) + "\n").encode()


def _format_surface(content: Content) -> list[str]:
    """Return the mesh of the surface; of a colored one with its texture, each face with vertices of its own."""
    vertices, faces = np.asarray(content.surface.vertices), np.asarray(content.surface.faces)
    places, texture = "", content.texture
    if texture is not None:
        # MuJoCo counts rows of a texture from the upper one, where vertices stand in the file.
        uv = np.array([0.0, 1.0]) + np.array([1.0, -1.0]) * texture.uv
        vertices, faces = vertices[faces.ravel()], np.arange(faces.size)
        places = f' texcoord="{_join(uv, digits=_UV_DIGITS)}"'
    corners = " ".join(map(str, faces.ravel().tolist()))
    mesh = f'<mesh name="arena_surface" inertia="shell" vertex="{_join(vertices)}"{places} face="{corners}"/>'
    if texture is None:
        return [mesh]
    return [
        mesh,
        f'<texture name="arena_surface" type="2d" file="{TEXTURE_FILE}"/>',
        '<material name="arena_surface" texture="arena_surface" specular="0" shininess="0"/>',
    ]


def _format_object(name: str, each: PlacedObject) -> Iterator[str]:
    """Return the geom of an object, which touches nothing, and its site."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, each.rotation.ravel())
    place = f'pos="{_join(each.position)}" quat="{_join(quaternion, digits=9)}"'
    yield (
        f'<geom name="{name}" type="mesh" mesh="{name}" {place} contype="0" conaffinity="0" '
        f'group="{OBJECT_GROUP}" mass="0" rgba="{_join(OBJECT_COLOR)}"/>'
    )
    yield f'<site name="{name}" {place} size="0.01"/>'


def _format_assets(content: Content) -> Iterator[str]:
    for solid in content.solids:
        if solid.box is None:
            yield f'<mesh name="{solid.name}" inertia="shell" vertex="{_join(solid.mesh.vertices)}"/>'
    if content.height_field is not None:
        field = content.height_field
        rows, columns = field.heights.shape
        lowest, rise = _compute_rise(field)
        size = [*((field.high - field.low) / 2), rise, FIELD_BASE]
        # MuJoCo reads the rows of an elevation from the far end to the near one.
        heights = ((field.heights - lowest) / rise)[::-1]
        yield (
            f'<hfield name="arena_height_field" nrow="{rows}" ncol="{columns}" size="{_join(size)}" '
            f'elevation="{_join(heights)}"/>'
        )


def _format_geoms(content: Content) -> Iterator[str]:
    colors = make_piece_colors(len(content.solids))
    common = f'contype="1" conaffinity="1" group="{CONTACT_GROUP}" mass="0"'
    ground = _format_friction(content.friction)
    for solid, color in zip(content.solids, colors, strict=True):
        friction = ground
        if solid.friction is not None:
            friction = f'{_format_friction(solid.friction)} priority="{PATCH_PRIORITY}"'
        look = f'rgba="{_join(color.round(3))}"'
        yield f'<geom name="{solid.name}" {_format_shape(solid)} {common} {friction} {look}/>'
    if content.height_field is not None:
        field = content.height_field
        position = [*((field.high + field.low) / 2), _compute_rise(field)[0]]
        yield (
            f'<geom name="arena_height_field" type="hfield" hfield="arena_height_field" '
            f'pos="{_join(position)}" {common} {ground}/>'
        )


def _format_friction(friction: float) -> str:
    return f'friction="{_join([friction, *ROLLING_FRICTION])}"'


def _format_shape(solid: Solid) -> str:
    if solid.box is None:
        return f'type="mesh" mesh="{solid.name}"'
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, solid.box.axes.ravel())
    return (
        f'type="box" pos="{_join(solid.box.center)}" quat="{_join(quaternion, digits=9)}" '
        f'size="{_join(solid.box.half_sizes)}"'
    )


def _compute_rise(field: HeightField) -> tuple[float, float]:
    """Return the lowest height, and how far the highest is above it [m]."""
    lowest = float(field.heights.min())
    return lowest, max(float(field.heights.max()) - lowest, LEAST_RISE)


def _join(values: Num[np.ndarray, " ..."] | list[float] | tuple[float, ...], digits: int = _DIGITS) -> str:
    """Return numbers as text, without zeros at the end."""
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0  # + 0.0 turns -0.0 into 0.0
    return " ".join(f"{value:.{digits}f}".rstrip("0").rstrip(".") for value in rounded.ravel().tolist())
