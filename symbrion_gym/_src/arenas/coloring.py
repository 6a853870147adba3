"""Arenas with the colors of points."""

from __future__ import annotations

from dataclasses import replace

from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces.color import paint_mesh
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.texture import make_texture
from symbrion_gym._src.arenas.texture_atlas import AtlasConfig
from symbrion_gym._src.errors import ArenaError


def color_arena(arena: Arena, cloud: Cloud, config: AtlasConfig | None = None) -> Arena:
    """Return an arena whose surface has the colors of the points around it; its contact stays the same.

    Args:
        arena: stays as it is.
        cloud: colored points, in the frame of the arena: coordinates of the scan minus `arena.offset` [m].
        config: how fine the texture is.

    Raises:
        ArenaError: the points have no colors.
    """
    if cloud.colors is None or not cloud.num_points:
        raise ArenaError("the cloud has no colored points; give a Cloud with colors")
    surface = arena.surface.copy()
    paint_mesh(surface, cloud)
    return replace(arena, surface=surface, texture=make_texture(surface, cloud, config))
