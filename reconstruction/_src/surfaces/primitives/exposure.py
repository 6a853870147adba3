"""Whether a closed shape covers more than a surface did."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.manifold import find_vertex_normals, group_sides
from reconstruction._src.surfaces.primitives.config import PrimitivesConfig
from reconstruction._src.surfaces.primitives.primitive import Primitive

_SAMPLES = 2000
"""Points on a shape at which that is looked at."""
_BEHIND = 2.0
"""Tolerances behind the surface from which on a point is hidden."""


class Surface:
    """A surface that says where free space is."""

    def __init__(self, vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> None:
        """Find the rim."""
        self._vertices, self._faces = vertices, faces
        self._normals = find_vertex_normals(vertices, faces)
        sides = group_sides(faces, len(vertices))
        slots = sides.slots[sides.starts[sides.counts == 1]]
        self._rim = np.zeros(len(vertices), dtype=bool)
        self._rim[faces.ravel()[slots]] = True
        self._rim[faces[:, [1, 2, 0]].ravel()[slots]] = True

    def is_closed_by(self, shape: Primitive, area: float, tolerance: float, config: PrimitivesConfig) -> bool:
        """Return whether faces cover enough of a closed shape, and all of it lies on the surface or behind it."""
        if area < config.min_covered * float(shape.as_mesh().area):
            return False
        return self.find_exposed(shape, tolerance) <= config.max_exposed

    def find_exposed(self, shape: Primitive, tolerance: float) -> float:
        """Return the share of a closed shape that neither lies on the surface nor behind it.

        A point whose nearest place of the surface is at the rim, where the surface ends, is not behind it.
        """
        mesh = shape.as_mesh()
        points, index = _sample(mesh.triangles, np.random.default_rng(0))
        return 1.0 - float(self.is_backed(points, mesh.face_normals[index], tolerance).mean())

    def is_backed(
        self, points: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"], tolerance: float
    ) -> Bool[np.ndarray, " N"]:
        """Return which points of a shape lie on the surface or behind it."""
        import igl

        squared, nearest, places = igl.point_mesh_squared_distance(points, self._vertices, self._faces)[:3]
        distance, nearest = np.sqrt(np.asarray(squared)), np.asarray(nearest)
        corners = self._faces[nearest]
        weights = 1.0 / (np.linalg.norm(self._vertices[corners] - np.asarray(places)[:, None], axis=2) + 1e-9)
        toward = np.einsum("nk,nkd->nd", weights, self._normals[corners])
        toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-12)
        front = np.einsum("nd,nd->n", points - np.asarray(places), toward)
        is_on = (distance <= _BEHIND * tolerance) & (np.einsum("nd,nd->n", normals, toward) > 0.0)
        at_rim = self._rim[corners].sum(axis=1) >= 2
        is_hidden = (front < 0) & ~at_rim
        return is_on | is_hidden


def _sample(
    triangles: Float[np.ndarray, "F 3 3"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return points that are spread evenly over triangles, and on which triangle each lies."""
    crossed = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(crossed, axis=1)
    index = np.searchsorted(np.cumsum(area), (np.arange(_SAMPLES) + 0.5) / _SAMPLES * area.sum())
    index = np.minimum(index, len(area) - 1)
    u, v = rng.random((2, _SAMPLES))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = np.moveaxis(triangles[index], 1, 0)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), index
