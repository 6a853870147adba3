"""Points inside convex solids, and how deep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int

from symbrion_gym._src.contact.kinds import HeightField

_MOST_VALUES = 4_000_000  # Distances of points from planes that are held at once: 32 MB
_LEAST_LENGTH = 1e-15  # A triangle whose edges have a shorter cross product has no normal [m²]
_PLANE_DIGITS = 9  # Planes that agree in all of these digits are one: the triangles of a flat side share it
_FACING = 0.2
"""Planes whose normal turns from a direction by more than 90 degrees, with this sine, look away from it."""


class ConvexSolids:
    """Convex solids that many points are compared with.

    Attributes:
        vertices: of all solids [m].
        faces: of all solids; their winding may be any.
    """

    def __init__(self, pieces: Sequence[trimesh.Trimesh]) -> None:
        """Take the triangles and planes of the pieces."""
        self._pieces = pieces
        starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
        self.vertices = np.concatenate(
            [np.zeros((0, 3)), *(np.asarray(p.vertices, np.float64) for p in pieces)]
        )
        faces = [np.asarray(p.faces, np.int64) + start for p, start in zip(pieces, starts, strict=False)]
        self.faces = np.concatenate([np.zeros((0, 3), np.int64), *faces])

    def compute_depths(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Return how deep points are [m]: the distance of the nearest plane, of the deepest solid; 0 outside."""
        depths = np.zeros(len(points))
        for members, below, _ in self._find_inside(points):
            depths[members] = np.maximum(depths[members], below.min(axis=1))
        return depths

    def compute_depths_behind(
        self, points: Float[np.ndarray, "N 3"], directions: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, " N"]:
        """Return how deep points are [m]: the distance of the nearest plane that does not look away from a
        direction."""
        found = np.zeros(len(points))
        for members, below, normals in self._find_inside(points):
            is_behind = directions[members] @ normals.T < -_FACING
            depths = np.where(is_behind, np.inf, below).min(axis=1)
            depths = np.where(np.isfinite(depths), depths, below.min(axis=1))
            found[members] = np.maximum(found[members], depths)
        return found

    def _find_inside(
        self, points: Float[np.ndarray, "N 3"]
    ) -> Iterator[tuple[Int[np.ndarray, " M"], Float[np.ndarray, "M P"], Float[np.ndarray, "P 3"]]]:
        """Give the points in each solid, their depths below its planes [m], and the planes' normals."""
        by_extent = np.argsort(-np.ptp(points, axis=0)) if len(points) else np.arange(3)
        order = np.argsort(points[:, by_extent[0]], kind="stable")
        ordered = np.ascontiguousarray(points[order].T)
        for piece in self._pieces:
            low, high = piece.bounds
            first, last = np.searchsorted(ordered[by_extent[0]], (low[by_extent[0]], high[by_extent[0]]))
            near = np.arange(first, last)
            for axis in by_extent[1:]:
                along = ordered[axis, near]
                near = near[(along > low[axis]) & (along < high[axis])]
            if not len(near):
                continue
            planes = find_planes(piece)
            step = max(_MOST_VALUES // len(planes), 1)
            for start in range(0, len(near), step):
                part = near[start : start + step]
                below = planes[:, 3] - ordered[:, part].T @ planes[:, :3].T
                is_inside = (below > 0).all(axis=1)
                if is_inside.any():
                    yield order[part[is_inside]], below[is_inside], planes[:, :3]


def compute_depths(
    points: Float[np.ndarray, "N 3"], pieces: Sequence[trimesh.Trimesh]
) -> Float[np.ndarray, " N"]:
    """Return how deep points are inside convex pieces [m]: the distance of the nearest plane, of the deepest piece."""
    return ConvexSolids(pieces).compute_depths(points)


def find_planes(piece: trimesh.Trimesh) -> Float[np.ndarray, "P 4"]:
    """Return the planes of a convex solid as outward unit normal and offset: inside, normal · x < offset."""
    corners = np.asarray(piece.triangles)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    is_flat = length[:, 0] > _LEAST_LENGTH
    normals, corner = normals[is_flat] / length[is_flat], corners[is_flat, 0]
    offsets = (normals * corner).sum(axis=1, keepdims=True)
    middle = np.asarray(piece.vertices).mean(axis=0)
    outward = np.where(normals @ middle[:, None] > offsets, -1.0, 1.0)
    return np.unique(np.round(outward * np.hstack([normals, offsets]), _PLANE_DIGITS), axis=0)


_IN_FRONT = 0.5
"""Cosine between the normal of the surface and the way to contact from which contact stands in front."""


class NearestPoints(NamedTuple):
    """Nearest points of a surface."""

    distances: Float[np.ndarray, " N"]  # how far they are [m]
    # the same distances, below 0 behind the surface: where its faces do not look to [m]
    heights: Float[np.ndarray, " N"]
    normals: Float[np.ndarray, "N 3"]  # unit normals of the nearest faces


def compute_offsets(
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
    depths = compute_depths(points, contact)
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
