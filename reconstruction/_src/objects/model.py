"""A known object, prepared for the search: samples with normals, a light mesh for rays, symmetries."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.decimation import simplify
from reconstruction._src.geometry.rows import cross_rows, find_areas, find_lengths
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.objects.nearest import NearestFaces, make_nearest_faces
from reconstruction._src.objects.symmetry import find_symmetries, list_turns

if TYPE_CHECKING:
    import trimesh

MAX_FACES = 400
"""Rays are cast at a mesh of no more faces than this."""
NUM_SAMPLES = 1200
_MIN_SIZE, _MAX_SIZE = 0.02, 5.0


class ObjectModel(NamedTuple):
    """A known object.

    Attributes:
        name: what it is called.
        vertices: `[V, 3]` of the mesh for rays and distances, in the object's frame [m].
        faces: `[F, 3]` wound with the normals outwards.
        normals: `[F, 3]` of the faces.
        points: `[P, 3]` samples [m].
        point_normals: `[P, 3]` normals at the samples.
        center: `[3]` middle of its area [m].
        radius: distance of the farthest vertex from it [m].
        nearest: the face nearest to each place about the object.
        spread: standard deviations of the samples along the principal axes, the smallest first [m].
        largest_side: area of the largest side of the bounding box [m²].
        turns: `[T, 3, 3]` rotations about the center that lead to poses the object could be mistaken in.
        symmetries: `[S, 3, 3]` rotations about the center under which the object looks the same.
    """

    name: str
    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    normals: Float[np.ndarray, "F 3"]
    points: Float[np.ndarray, "P 3"]
    point_normals: Float[np.ndarray, "P 3"]
    center: Float[np.ndarray, " 3"]
    radius: float
    nearest: NearestFaces
    spread: Float[np.ndarray, " 3"]
    largest_side: float
    turns: Float[np.ndarray, "T 3 3"]
    symmetries: Float[np.ndarray, "S 3 3"]


def make_model(name: str, mesh: trimesh.Trimesh) -> ObjectModel:
    """Prepare an object."""
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise ReconstructionError(f"object {name!r}: the mesh has no faces, or vertices that are not finite")
    low, high = np.asarray(mesh.bounds, dtype=np.float64)
    size = float((high - low).max())
    if not _MIN_SIZE <= size <= _MAX_SIZE:
        raise ReconstructionError(
            f"object {name!r} is {size:.4g} m long; objects of {_MIN_SIZE:g} to {_MAX_SIZE:g} m can be found "
            "(is the mesh in meters?)"
        )
    full_vertices, full_faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    vertices, faces = simplify(full_vertices, full_faces, min(MAX_FACES, len(full_faces)))
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    normals = _find_normals(vertices, faces)
    points = sample_area(vertices, faces, NUM_SAMPLES, 0)
    center = np.average(vertices[faces].mean(axis=1), axis=0, weights=find_areas(vertices, faces))
    sides = np.sort(high - low)
    radius = float(find_lengths(vertices - center).max())
    return ObjectModel(
        name,
        vertices,
        faces,
        normals,
        points,
        normals[_find_nearest_faces(points, vertices, faces)],
        center,
        radius,
        make_nearest_faces(vertices, faces, radius),
        find_spread(points),
        float(sides[1] * sides[2]),
        list_turns(_find_axes(points)),
        find_symmetries(mesh, center),
    )


def _find_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = vertices[faces]
    normals = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.maximum(find_lengths(normals), 1e-300)[:, None]


def _find_nearest_faces(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    import igl

    return np.asarray(igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)[1])


def find_spread(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " 3"]:
    """Return the standard deviations of points along their principal axes, the smallest first [m]."""
    offset = points - points.mean(axis=0)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(offset.T @ offset / len(points)), 0.0))


def _find_axes(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the principal axes of points, as columns of a rotation."""
    offset = points - points.mean(axis=0)
    axes = np.linalg.eigh(offset.T @ offset)[1]
    return axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])
