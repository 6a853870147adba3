"""A table of the face that is nearest to each place about an object, for fits to many poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

_NUM_STEPS = 36
"""Fields along the longest side of the table: an eighteenth of the radius each, nearly."""
REACH = 0.5
"""The table reaches as far beyond the object, as a share of its radius."""


class NearestFaces(NamedTuple):
    """The nearest face of each field of a grid.

    Attributes:
        low: `[3]` corner of the grid [m].
        step: width of a field [m].
        face: `[A, B, C]` index of the face that is nearest to the middle of a field.
        distance: `[A, B, C]` from the middle to it [m].
    """

    low: Float[np.ndarray, " 3"]
    step: float
    face: Int[np.ndarray, "A B C"]
    distance: Float[np.ndarray, "A B C"]

    def find(
        self, points: Float[np.ndarray, "K M 3"]
    ) -> tuple[Float[np.ndarray, "K M"], Int[np.ndarray, "K M"]]:
        """Return about the distance [m] and the nearest face of each point; infinite off the table."""
        field = np.floor((points - self.low) / self.step).astype(np.int64)
        inside = ((field >= 0) & (field < self.face.shape)).all(axis=-1)
        i, j, k = np.where(np.asarray(inside)[..., None], field, 0).reshape(-1, 3).T
        distance = np.where(inside, self.distance[i, j, k].reshape(inside.shape), np.inf)
        return distance, self.face[i, j, k].reshape(inside.shape)


def make_nearest_faces(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], radius: float
) -> NearestFaces:
    """Make the table of an object [m]."""
    import igl

    low = vertices.min(axis=0) - REACH * radius
    extent = vertices.max(axis=0) + REACH * radius - low
    step = float(extent.max()) / _NUM_STEPS
    shape = tuple(np.ceil(extent / step).astype(int))
    fields = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    middles = np.ascontiguousarray(low + (fields + 0.5) * step)
    squared, face = igl.point_mesh_squared_distance(middles, vertices, faces)[:2]
    return NearestFaces(
        low, step, np.asarray(face, np.int64).reshape(shape), np.sqrt(np.asarray(squared)).reshape(shape)
    )
