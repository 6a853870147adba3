"""OBJ: the contact pieces as objects of one file, and the surface; also the meshes that a URDF names."""

from __future__ import annotations

import numpy as np
import trimesh

from symbrion_gym._src.arenas.export.content import Content
from symbrion_gym._src.arenas.obj_mesh import format_surface
from symbrion_gym._src.arenas.png import to_png
from symbrion_gym._src.arenas.texture import TEXTURE_FILE

_DIGITS = 6
"""Coordinates to 1 µm, as in a saved arena."""


def format_obj(content: Content) -> dict[str, bytes]:
    """Return `contact.obj`, one object a piece, and `surface.obj`."""
    lines: list[str] = []
    used = 0
    named = [(solid.name, solid.mesh) for solid in content.solids]
    if content.height_field is not None:
        named.append(("arena_height_field", content.height_field.as_mesh()))
    for name, mesh in named:
        lines += [f"o {name}", *_format_lines(mesh, used)]
        used += len(mesh.vertices)
    return {"contact.obj": _join(lines), **format_colored(content)}


def format_colored(content: Content) -> dict[str, bytes]:
    """Return `surface.obj`; of a colored surface with its vertex colors, and its texture and material as files."""
    if content.texture is None:
        return {"surface.obj": format_mesh(content.surface)}
    head = b"mtllib surface.mtl\nusemtl surface\n"
    return {
        "surface.obj": head + format_surface(content.surface, content.texture, _DIGITS),
        "surface.mtl": f"newmtl surface\nKa 1 1 1\nKd 1 1 1\nmap_Kd {TEXTURE_FILE}\n".encode(),
        TEXTURE_FILE: to_png(content.texture.image),
    }


def format_mesh(mesh: trimesh.Trimesh) -> bytes:
    """Return one mesh as a file."""
    return _join(_format_lines(mesh, 0))


def _format_lines(mesh: trimesh.Trimesh, used: int) -> list[str]:
    """Return vertices and faces; OBJ counts vertices over all objects of a file, from 1."""
    # + 0.0 turns -0.0 into 0.0.
    vertices = np.round(np.asarray(mesh.vertices, dtype=np.float64), _DIGITS) + 0.0
    lines = [f"v {x:.{_DIGITS}f} {y:.{_DIGITS}f} {z:.{_DIGITS}f}" for x, y, z in vertices.tolist()]
    return lines + [f"f {a} {b} {c}" for a, b, c in (np.asarray(mesh.faces) + 1 + used).tolist()]


def _join(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
