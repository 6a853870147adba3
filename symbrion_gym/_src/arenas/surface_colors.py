"""The colors of an arena's surface at any place: of an exact course by its pattern, else by its texture."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8

from reconstruction._src.geometry.rows import compute_areas
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces.color import WHITE, add_alpha
from symbrion_gym._src.arenas.course import PATTERNS, Course, StairsCourse
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


def compute_distances(
    positions: Float[np.ndarray, "N 3"], surface: trimesh.Trimesh
) -> Float[np.ndarray, " N"]:
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


_NUM_SAMPLES = 200_000  # Points on the faces, beside the vertices: 1 cm apart on 20 m²

_logger = logging.getLogger(__name__)


def sample_mesh_colors(mesh: trimesh.Trimesh, vertices: Float[np.ndarray, "V 3"]) -> Cloud | None:
    """Return points on a mesh with its colors: those of its vertices, its faces or its texture; None without colors."""
    visual: Any = mesh.visual
    faces = np.asarray(mesh.faces)
    if visual is None or not visual.defined or not len(faces) or not np.isfinite(vertices).all():
        return None
    if isinstance(visual, trimesh.visual.TextureVisuals) and not _has_picture(visual):
        return None
    rng = np.random.default_rng(0)
    areas = compute_areas(vertices, faces)
    if not areas.sum() > 0:
        return None
    place = (np.arange(_NUM_SAMPLES) + 0.5) / _NUM_SAMPLES * areas.sum()
    face = np.minimum(np.searchsorted(np.cumsum(areas), place), len(faces) - 1)
    weights = rng.dirichlet(np.ones(3), _NUM_SAMPLES)
    try:
        colors = _find_colors(mesh, face, weights)
    except (
        Exception
    ) as error:  # trimesh needs a library for pictures, and files name pictures that are not there
        _logger.warning("the colors of the mesh are left out: %s", error)
        return None
    return Cloud(np.einsum("sk,ski->si", weights, vertices[faces[face]]), colors)


def _has_picture(visual: trimesh.visual.TextureVisuals) -> bool:
    """Return whether a mesh has a picture: one plain color for all is that of a program, not of a scan."""
    material = visual.material
    pictures = (getattr(material, name, None) for name in ("image", "baseColorTexture"))
    return visual.uv is not None and any(picture is not None for picture in pictures)


def _find_colors(
    mesh: trimesh.Trimesh, face: np.ndarray, weights: Float[np.ndarray, "S 3"]
) -> UInt8[np.ndarray, "S 3"]:
    """Return the colors of places on faces."""
    visual: Any = mesh.visual
    corners = np.asarray(mesh.faces)[face]
    if isinstance(visual, trimesh.visual.TextureVisuals):
        uv = np.asarray(visual.uv)
        found = visual.material.to_color(np.einsum("sk,ski->si", weights, uv[corners]))
        return np.ascontiguousarray(np.asarray(found)[:, :3], dtype=np.uint8)
    if visual.kind == "face":
        return np.ascontiguousarray(np.asarray(visual.face_colors)[face, :3], dtype=np.uint8)
    mixed = np.einsum("sk,ski->si", weights, np.asarray(visual.vertex_colors)[corners, :3].astype(np.float64))
    return np.round(mixed).astype(np.uint8)
