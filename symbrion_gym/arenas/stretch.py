"""Arenas a little longer or shorter than their scan says: a survey knows lengths to about a centimetre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course


def stretch_arena(arena: Arena, factor: float) -> Arena:
    """Return the arena with all lengths along x multiplied; pieces stay convex, heights as they are.

    Args:
        arena: stays as it is.
        factor: 1 returns the arena itself.
    """
    if factor == 1.0:
        return arena
    course, heights = arena.course, arena.height_field
    if course is not None:
        names = (
            ("pit", "floor", "ramp", "plateau") if isinstance(course, Course) else ("run", "floor", "plateau")
        )
        course = replace(course, **{name: factor * getattr(course, name) for name in names})
    if heights is not None:
        along = np.array([factor, 1.0])
        heights = heights._replace(low=heights.low * along, high=heights.high * along)
    return replace(
        arena,
        pieces=[_stretch(piece, factor) for piece in arena.pieces],
        surface=_stretch(arena.surface, factor),
        course=course,
        height_field=heights,
    )


def _stretch(mesh: trimesh.Trimesh, factor: float) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices * np.array([factor, 1.0, 1.0]), mesh.faces, process=False)
