"""Colors of a surface: each place takes the weighted mean of the colored points around it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, UInt8
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.rows import Points
from reconstruction._src.scans.cloud import Cloud

Paint = Callable[[Points], ArrayLike]  # Returns the colors of positions [m], 0 to 1
WHITE = 255  # The largest value of a channel in bytes
_TINY = 1e-30  # Keeps weights finite where a point lies on a place [1/m²]


_NEIGHBORS = 6
"""So many nearest points count: more average the camera's noise away, fewer keep edges sharp. Six are those
around a place on an even surface."""
_SOFTENING = 0.5
"""A point weighs 1 / (d² + softening * mean d²) of the neighbors' distances d: 0 would take the color of a
point that a place lies on, large values the plain mean."""
_CONTRAST = 0.1
"""A point whose color differs from that of the nearest one by this, in the root of the mean square of the
channels (of 1), weighs e^-1/2 as much: several times a camera's noise, so that edges stay sharp."""
_BEHIND = 1e-6  # Weight of a point that was seen from behind the place, as the far side of a thin wall is


class ColorSource:
    """Colored points, ready to be asked for the color of any place near them."""

    def __init__(self, cloud: Cloud) -> None:
        if cloud.colors is None or not cloud.num_points:
            raise ReconstructionError("the cloud has no colored points; give colors [N, 3], 0 to 255")
        self._colors = cloud.colors.astype(np.float32)
        self._points, self._origins = cloud.points, cloud.origins
        # Without balance and tight boxes a tree is made in a third of the time; answers are the same.
        self._tree = cKDTree(cloud.points, balanced_tree=False, compact_nodes=False)

    def find_colors(
        self, places: Float[np.ndarray, "P 3"], normals: Float[np.ndarray, "P 3"] | None = None
    ) -> UInt8[np.ndarray, "P 3"]:
        """Return red, green and blue of places, 0 to 255."""
        if not len(places):
            return np.zeros((0, 3), np.uint8)
        count = min(_NEIGHBORS, len(self._points))
        distance, nearest = self._tree.query(places, k=list(range(1, count + 1)))
        square = distance**2
        weights = 1.0 / (square + _SOFTENING * square.mean(axis=1, keepdims=True) + _TINY)
        if normals is not None and self._origins is not None:
            towards = self._origins[nearest] - self._points[nearest]
            is_behind = np.einsum("pki,pi->pk", towards, normals) < 0
            weights = np.where(is_behind, _BEHIND * weights, weights)
        colors = self._colors[nearest]
        first = colors[np.arange(len(colors)), weights.argmax(axis=1)]
        contrast = ((colors - first[:, None]) ** 2).mean(axis=2) / (WHITE * _CONTRAST) ** 2
        weights *= np.exp(-contrast / 2)
        weights /= weights.sum(axis=1, keepdims=True)
        mixed = np.einsum("pk,pki->pi", weights, colors)
        return np.clip(np.round(mixed), 0, WHITE).astype(np.uint8)


def paint_mesh(mesh: trimesh.Trimesh, cloud: Cloud) -> None:
    """Give the vertices of a mesh the colors of the points around them (`mesh.visual.vertex_colors`)."""
    normals = None if cloud.origins is None else np.asarray(mesh.vertex_normals)
    colors = ColorSource(cloud).find_colors(np.asarray(mesh.vertices), normals)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=add_alpha(colors))


def find_vertex_colors(mesh: trimesh.Trimesh) -> UInt8[np.ndarray, "V 3"] | None:
    """Return red, green and blue of the vertices of a mesh; None where it has none of its own."""
    visual: Any = mesh.visual
    if not isinstance(visual, trimesh.visual.ColorVisuals) or visual.kind != "vertex":
        return None
    return np.ascontiguousarray(np.asarray(visual.vertex_colors)[:, :3], dtype=np.uint8)


def copy_vertex_colors(source: trimesh.Trimesh, target: trimesh.Trimesh) -> None:
    """Give a mesh the vertex colors of one with the same vertices, where it has any."""
    colors = find_vertex_colors(source)
    if colors is not None:
        target.visual = trimesh.visual.ColorVisuals(target, vertex_colors=add_alpha(colors))


def add_alpha(colors: UInt8[np.ndarray, "V 3"]) -> UInt8[np.ndarray, "V 4"]:
    """Return opaque colors."""
    return np.concatenate([colors, np.full((len(colors), 1), WHITE, np.uint8)], axis=1)


def match_colors(known: Cloud, added: Cloud) -> tuple[Cloud, str]:
    """Return new points with colors where the known ones have some, and what was done about it, in words.

    Points without colors take those of the known points around them: a robot's laser has no camera. Colors of new
    points are dropped where the known ones have none: a surface is colored as a whole or not at all.
    """
    if known.colors is None:
        if added.colors is None:
            return added, ""
        note = (
            "those of the new readings were dropped: the first ones have none; reconstruct all points again"
        )
        return added.replace(colors=None), note
    if added.colors is not None:
        return added, ""
    colors = ColorSource(known).find_colors(added.points)
    return added.replace(colors=colors), f"{added.num_points} new readings without took those around them"
