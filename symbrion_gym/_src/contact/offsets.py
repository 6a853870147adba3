"""Where contact geometry lies relative to its surface, point by point: what a picture of the error shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int

from symbrion_gym._src.contact.inside import find_depths
from symbrion_gym._src.contact.kinds import HeightField

_IN_FRONT = 0.5
"""Cosine between the normal of the surface and the way to contact from which contact stands in front."""


class NearestPoints(NamedTuple):
    """Nearest points of a surface.

    Attributes:
        distances: how far they are [m].
        heights: the same distances, below 0 behind the surface: where its faces do not look to [m].
        normals: unit normals of the nearest faces.
    """

    distances: Float[np.ndarray, " N"]
    heights: Float[np.ndarray, " N"]
    normals: Float[np.ndarray, "N 3"]


def find_offsets(
    points: Float[np.ndarray, "N 3"],
    normals: Float[np.ndarray, "N 3"],
    contact: Sequence[trimesh.Trimesh] | HeightField,
) -> Float[np.ndarray, " N"]:
    """Return signed distances of points of a surface from contact geometry [m]."""
    meshes = [contact.as_mesh()] if isinstance(contact, HeightField) else contact
    if not len(meshes) or not len(points):
        return np.full(len(points), -np.inf)
    ways = _find_places(points, *join_meshes(meshes)) - points
    distances = np.linalg.norm(ways, axis=1)
    is_in_front = (ways * normals).sum(axis=1) > _IN_FRONT * distances
    if isinstance(contact, HeightField):
        return np.where(is_in_front, distances, -distances)
    depths = find_depths(points, contact)
    return np.where(depths > 0.0, depths, np.where(is_in_front, distances, -distances))


def find_nearest(points: Float[np.ndarray, "N 3"], surface: trimesh.Trimesh) -> NearestPoints:
    """Return how far points are from a surface, on which side, and how the surface faces there."""
    import igl

    vertices, index = np.unique(np.asarray(surface.vertices, dtype=np.float64), axis=0, return_inverse=True)
    faces = index.ravel()[np.asarray(surface.faces)]
    normals = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    lengths = np.linalg.norm(normals, axis=1)
    is_face = lengths > 0
    normals, faces = normals[is_face] / lengths[is_face, None], np.ascontiguousarray(faces[is_face])
    heights, face, _, _ = igl.signed_distance(
        np.ascontiguousarray(points, dtype=np.float64), vertices, faces, igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    )
    heights = np.ravel(heights)
    return NearestPoints(np.abs(heights), heights, normals[np.ravel(face)])


def join_meshes(
    meshes: Sequence[trimesh.Trimesh],
) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Return vertices and faces of several meshes as those of one; each keeps its own vertices."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([np.zeros((0, 3)), *(np.asarray(mesh.vertices) for mesh in meshes)])
    faces = [np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    return vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces])


def _find_places(
    points: Float[np.ndarray, "N 3"], vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "N 3"]:
    """Return the nearest points of triangles."""
    import igl

    found = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
    )
    return np.asarray(found[2], dtype=np.float64)
