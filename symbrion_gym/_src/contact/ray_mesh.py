"""Exact rays on triangles: MuJoCo's bounding-volume tree over all triangles of several meshes at once."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction._src.geometry.rows import find_areas

_LEAST_AREA = 1e-12
"""Triangles with less are no shape [m²]; a ray hits their neighbors."""


class RayMesh:
    """Casts rays on the triangles of meshes, from both sides; the first triangle along a ray counts."""

    def __init__(self, meshes: Sequence[trimesh.Trimesh]) -> None:
        """Build the tree."""
        self._middle = np.zeros(3)
        self._model: mujoco.MjModel | None = None
        ends = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        vertices = np.concatenate([np.zeros((0, 3)), *(np.asarray(mesh.vertices) for mesh in meshes)])
        faces = np.concatenate(
            [
                np.zeros((0, 3), dtype=np.int64),
                *(np.asarray(mesh.faces) + end for mesh, end in zip(meshes, ends[:-1], strict=True)),
            ]
        )
        faces = faces[find_areas(vertices, faces) > _LEAST_AREA]
        if not len(faces):
            return
        used, index = np.unique(faces, return_inverse=True)
        vertices = vertices[used]
        self._middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2  # MuJoCo keeps vertices as float32
        vertices -= self._middle
        spec = mujoco.MjSpec()
        spec.add_mesh(
            name="triangles",
            uservert=vertices.ravel(),
            userface=index.astype(np.int32).ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname="triangles", contype=0, conaffinity=0
        )
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)

    def cast(
        self, origins: Float[np.ndarray, "R 3"], directions: Float[np.ndarray, "R 3"]
    ) -> Float[np.ndarray, " R"]:
        """Return the distance of the first triangle along each ray [m]; inf where there is none."""
        distances = np.full(len(origins), np.inf)
        if self._model is None or not len(origins):
            return distances
        if (origins == origins[0]).all():
            return self.cast_fans(origins[:1], directions, np.array([len(directions)]))
        places, group = np.unique(origins, axis=0, return_inverse=True)
        order = np.argsort(group.ravel(), kind="stable")
        distances[order] = self.cast_fans(places, directions[order], np.bincount(group.ravel()))
        return distances

    def cast_fans(
        self,
        origins: Float[np.ndarray, "F 3"],
        directions: Float[np.ndarray, "R 3"],
        counts: Int[np.ndarray, " F"],
    ) -> Float[np.ndarray, " R"]:
        """Return the distance of the first triangle along each ray of fans [m]; inf where there is none."""
        count = len(directions)
        if self._model is None or not count:
            return np.full(count, np.inf)
        distances, geoms = np.empty(count), np.full(count, -1, np.int32)
        flat, stops = np.ascontiguousarray(directions).ravel(), np.cumsum(counts).tolist()
        start = 0
        for place, stop in zip(np.ascontiguousarray(origins - self._middle), stops, strict=True):
            if stop > start:
                mujoco.mj_multiRay(
                    self._model, self._data, place, flat[3 * start : 3 * stop], None, True, -1,
                    geoms[start:stop], distances[start:stop], None, stop - start, mujoco.mjMAXVAL,
                )  # fmt: skip
            start = stop
        return np.where(geoms < 0, np.inf, distances)
