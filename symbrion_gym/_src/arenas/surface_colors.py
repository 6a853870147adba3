"""The colors of an arena's surface at any place: of an exact course by its pattern, else by its texture."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction._src.surfaces.color import WHITE, add_alpha
from symbrion_gym._src.arenas.color_patterns import PATTERNS
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.texture import SurfaceTexture, paint_texture
from symbrion_gym._src.errors import ArenaError


def paint_course(surface: trimesh.Trimesh, pattern: str) -> SurfaceTexture:
    """Give the vertices of an exact surface the colors of a pattern, and return its texture."""
    paint = PATTERNS[pattern]
    colors = np.round(WHITE * paint(np.asarray(surface.vertices))).astype(np.uint8)
    surface.visual = trimesh.visual.ColorVisuals(surface, vertex_colors=add_alpha(colors))
    return paint_texture(surface, paint)


def find_surface_colors(
    surface: trimesh.Trimesh,
    texture: SurfaceTexture | None,
    course: Course | StairsCourse | None,
    positions: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 3"]:
    """Return the colors (0 to 1) of the places of a surface that are nearest to positions."""
    if course is not None and course.color_pattern:
        return PATTERNS[course.color_pattern](positions)
    if texture is None:
        raise ArenaError(
            "the arena has no colors; make it of a colored scan or mesh, or of a Course with a color_pattern"
        )
    _, face, nearest = _find_nearest(surface, positions)
    weights = trimesh.triangles.points_to_barycentric(np.asarray(surface.triangles)[face], nearest)
    weights = np.clip(np.nan_to_num(weights, nan=1 / 3), 0.0, 1.0)
    return texture.find_colors(face, weights / weights.sum(axis=1, keepdims=True))


def find_distances(positions: Float[np.ndarray, "N 3"], surface: trimesh.Trimesh) -> Float[np.ndarray, " N"]:
    """Return the distances of positions from a surface [m]."""
    return np.sqrt(_find_nearest(surface, positions)[0])


def _find_nearest(
    surface: trimesh.Trimesh, positions: Float[np.ndarray, "N 3"]
) -> tuple[Float[np.ndarray, " N"], Int[np.ndarray, " N"], Float[np.ndarray, "N 3"]]:
    """Return squared distance, face and place of the nearest points of a surface."""
    import igl

    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    square, face, nearest = igl.point_mesh_squared_distance(np.ascontiguousarray(positions), vertices, faces)
    return (
        np.atleast_1d(np.asarray(square)),
        np.atleast_1d(np.asarray(face, dtype=np.int64)),
        np.reshape(np.asarray(nearest), (-1, 3)),
    )
