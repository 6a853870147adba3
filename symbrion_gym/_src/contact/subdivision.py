"""Coarse meshes cut finer: what compares neighboring faces needs some on every plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Int

_MOST_ROUNDS = 60
"""Halving edges so often would make any of them vanish: the loop ends long before."""


@dataclass(frozen=True)
class SubdivisionConfig:
    """Which meshes are cut finer.

    Attributes:
        max_edge: longest edge, relative to the extent, of a mesh cut finer.
        coarse_edge: a face with an edge longer than this, relative to the extent, is coarse.
        coarse_share: meshes with less of their area in coarse faces stay as they are.
        max_faces: halving ends beyond: a broken mesh can be large and all slivers.
    """

    max_edge: float = 1.0 / 25.0
    coarse_edge: float = 1.0 / 20.0
    coarse_share: float = 0.2
    max_faces: int = 8000


SUBDIVISION_DEFAULTS = SubdivisionConfig()


def split_long_edges(
    mesh: trimesh.Trimesh, config: SubdivisionConfig = SUBDIVISION_DEFAULTS
) -> trimesh.Trimesh:
    """Return the same surface without long edges, if coarse faces make up much of it; else the mesh itself.

    The longest edges of faces are halved until there are none, or too many faces. Their neighbors are cut to suit.
    """
    extent = float(mesh.extents.max())
    lengths = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, -1, axis=1), axis=2)
    is_coarse = lengths.max(axis=1) > config.coarse_edge * extent
    if mesh.area_faces[is_coarse].sum() < config.coarse_share * mesh.area:
        return mesh
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    for _ in range(_MOST_ROUNDS):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, number = np.unique(edges, axis=0, return_inverse=True)
        length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        number = number.reshape(-1, 3)
        is_longest = np.zeros(len(edges), dtype=bool)
        is_longest[number[np.arange(len(faces)), np.argmax(length[number], axis=1)]] = True
        is_long = is_longest & (length > config.max_edge * extent)
        if not is_long.any() or len(faces) > config.max_faces:
            break
        middle = np.full(len(edges), -1)
        middle[is_long] = len(vertices) + np.arange(is_long.sum())
        vertices = np.concatenate([vertices, vertices[edges[is_long]].mean(axis=1)])
        faces = _cut_faces(faces, middle[number])
    return trimesh.Trimesh(vertices, faces, process=False)


def _cut_faces(faces: Int[np.ndarray, "F 3"], middles: Int[np.ndarray, "F 3"]) -> Int[np.ndarray, "G 3"]:
    """Cut faces at the middles of their edges."""
    count = (middles >= 0).sum(axis=1)
    # The whole edge of two, or the cut edge of one, goes to a known place.
    first = np.where(count == 1, np.argmax(middles >= 0, axis=1), np.argmin(middles >= 0, axis=1))
    turned = (first[:, None] + np.arange(3)) % 3
    faces, middles = np.take_along_axis(faces, turned, 1), np.take_along_axis(middles, turned, 1)
    a, b, c = faces.T
    ab, bc, ca = middles.T
    templates = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(bc, c, ca), (a, b, bc), (a, bc, ca)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    parts = [
        np.stack(corners, axis=1)[count == number] for number, cut in templates.items() for corners in cut
    ]
    return np.concatenate(parts)
