"""What of a surface robots can touch: all that is no higher than a reach above ground beside it."""

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.geometry.sampling import sample_area

_GROUND_RISE = 0.7  # Normals of ground rise by more: no track climbs slopes above 45 degrees
_GROUND_EDGE = 5.0  # Ground is as large as a square of so many robots along its edge: a table, but no chair
_CELL = 0.3  # Ground in a cell of the plan and those around it counts [m]: next to a wall it is often hidden
_SPACING = 0.1  # Of the places on the ground that are looked at [m]
_MOST_PLACES = 500_000  # They are farther apart where there would be more
_ON_GROUND = 0.05  # What is no farther below ground is at its height [m]: noise


class Reach:
    """Heights above the ground on which a body has room; several storeys have ground each.

    Ground are parts of the surface that look up, tables included. Where there is none, the nearest one in plan
    counts, and where there is none at all, all is within reach.
    """

    def __init__(self, surface: trimesh.Trimesh, reach: float, size: float) -> None:
        """Find the ground of an oriented surface, for a robot of some size [m]."""
        rises = np.asarray(surface.face_normals)[:, 2] > _GROUND_RISE
        pairs = np.asarray(surface.face_adjacency).reshape(-1, 2)
        part = trimesh.graph.connected_component_labels(pairs[rises[pairs].all(axis=1)], len(rises))
        areas = np.where(rises, surface.area_faces, 0.0)
        is_ground = rises & (np.bincount(part, areas)[part] >= (_GROUND_EDGE * size) ** 2)
        count = int(min(areas[is_ground].sum() / _SPACING**2, _MOST_PLACES)) + 1
        faces = np.asarray(surface.faces)[is_ground]
        self._reach, self._places = reach, np.zeros((0, 3))
        if len(faces):
            self._places = sample_area(np.asarray(surface.vertices), faces, count)
            self._low = np.asarray(surface.bounds)[0] - [_CELL, _CELL, 1.0]
            self._high = np.asarray(surface.bounds)[1] - self._low + 1.0
            around = np.array([(i, j, 0.0) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * _CELL
            self._keys = np.unique(self._find_keys((self._places[:, None] + around).reshape(-1, 3)))

    def _find_keys(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Return numbers that grow with the height in a cell, and are apart for different cells."""
        places = np.clip(points - self._low, 0.0, self._high)
        row, column = np.floor(places[:, :2] / _CELL).T
        return (row * np.ceil(self._high[1] / _CELL + 1.0) + column) * self._high[2] + places[:, 2]

    def measure_excess(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Return how far points are beyond the reach above the highest ground beneath and beside them [m]."""
        if not len(self._places) or not len(points):
            return np.full(len(points), -np.inf)
        keys = self._find_keys(points + np.array([0.0, 0.0, _ON_GROUND]))
        above = keys - self._keys[np.maximum(np.searchsorted(self._keys, keys, side="right") - 1, 0)]
        is_known = (above >= 0) & (above <= points[:, 2] - self._low[2])  # else it belongs to another cell
        nearest = cKDTree(self._places[:, :2]).query(points[~is_known, :2])[1]
        height = above - _ON_GROUND
        height[~is_known] = points[~is_known, 2] - self._places[nearest, 2]
        return height - self._reach

    def take_near(self, mesh: trimesh.Trimesh, beyond: bool = False) -> trimesh.Trimesh:
        """Return the faces of a mesh that come within reach, or the others."""
        excess = self.measure_excess(np.asarray(mesh.vertices))[mesh.faces]
        part = trimesh.Trimesh(mesh.vertices, mesh.faces[(excess > 0).all(axis=1) == beyond], process=False)
        return _split_pinched(part)


def _split_pinched(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a mesh with a vertex for each fan of faces: where faces are taken away, two may meet in a point."""
    faces = np.asarray(mesh.faces)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    links = [
        3 * pairs + np.argmax(faces[pairs] == ends[:, None, None], axis=2)
        for ends in np.asarray(mesh.face_adjacency_edges).reshape(-1, 2).T
    ]
    fan = trimesh.graph.connected_component_labels(np.concatenate(links), 3 * len(faces))
    _, first, number = np.unique(fan, return_index=True, return_inverse=True)
    vertices = np.asarray(mesh.vertices)[faces.ravel()[first]]
    return trimesh.Trimesh(vertices, number.reshape(-1, 3), process=False)
