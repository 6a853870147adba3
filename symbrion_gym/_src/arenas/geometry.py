"""What of an arena has a shape: the surface, and what stands in for it in contact."""

from __future__ import annotations

from typing import NamedTuple

import trimesh

from reconstruction._src.surfaces.primitives.find import Primitives
from symbrion_gym._src.arenas.texture import SurfaceTexture
from symbrion_gym._src.contact.kinds import HeightField


class ArenaGeometry(NamedTuple):
    """The shapes of an arena.

    Attributes:
        surface: the exact surface, for rays and pictures.
        pieces: convex solids, for contact.
        height_field: in place of pieces, for the kind "hfield".
        texture: colors of the surface; None where they are unknown.
        primitives: in place of triangles, for the kind "mixed"; the solid ones are the last pieces.
    """

    surface: trimesh.Trimesh
    pieces: list[trimesh.Trimesh]
    height_field: HeightField | None
    texture: SurfaceTexture | None = None
    primitives: Primitives | None = None
