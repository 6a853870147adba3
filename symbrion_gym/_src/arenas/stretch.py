"""Arenas a little longer or shorter than their scan says: a survey measures lengths to about a centimeter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from reconstruction._src.geometry.halfspaces import find_box
from reconstruction._src.surfaces.color import copy_vertex_colors
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.placed_objects import stretch_objects


def stretch_arena(arena: Arena, factor: float) -> Arena:
    """Return the arena with all lengths along x multiplied; boxes stay boxes, heights as they are."""
    if factor == 1.0:
        return arena
    course, heights, friction_map = arena.course, arena.height_field, arena.friction_map
    if course is not None:
        names = (
            ("pit", "floor", "ramp", "plateau") if isinstance(course, Course) else ("run", "floor", "plateau")
        )
        course = replace(course, **{name: factor * getattr(course, name) for name in names})
        if isinstance(course, Course) and course.friction_patches:
            patches = [(factor * x0, factor * x1, *rest) for x0, x1, *rest in course.friction_patches]
            course = replace(course, friction_patches=tuple(patches))
    if heights is not None:
        along = np.array([factor, 1.0])
        heights = heights._replace(low=heights.low * along, high=heights.high * along)
    return replace(
        arena,
        pieces=[_stretch_piece(piece, factor) for piece in arena.pieces],
        surface=_stretch(arena.surface, factor),
        course=course,
        height_field=heights,
        friction_map=None if friction_map is None else friction_map.stretch(factor),
        kind="convex" if arena.kind == "mixed" else arena.kind,
        primitives=None,
        objects=stretch_objects(arena.objects, factor),
    )


def _stretch(mesh: trimesh.Trimesh, factor: float) -> trimesh.Trimesh:
    stretched = trimesh.Trimesh(mesh.vertices * np.array([factor, 1.0, 1.0]), mesh.faces, process=False)
    copy_vertex_colors(mesh, stretched)
    return stretched


def _stretch_piece(piece: trimesh.Trimesh, factor: float) -> trimesh.Trimesh:
    """Return a contact piece stretched; a box becomes the box with the same top, stretched."""
    box = find_box(piece)
    if box is None:
        return _stretch(piece, factor)
    center, half_sizes, axes = box
    up = int(np.abs(axes[2]).argmax())
    first, second = (axes[:, k] * [factor, 1.0, 1.0] for k in range(3) if k != up)
    sizes = half_sizes[[k for k in range(3) if k != up]] * np.linalg.norm([first, second], axis=1)
    first /= np.linalg.norm(first)
    normal = np.cross(first, second)
    normal *= np.sign(normal[2]) / np.linalg.norm(normal)
    top = center + axes[:, up] * np.sign(axes[2, up]) * half_sizes[up]
    frame = np.column_stack([first, np.cross(normal, first), normal])
    stretched = trimesh.creation.box(2 * np.array([*sizes, half_sizes[up]]))
    middle = top * [factor, 1.0, 1.0] - normal * half_sizes[up]
    return trimesh.Trimesh(stretched.vertices @ frame.T + middle, stretched.faces, process=False)
