"""Vertices moved onto the planes fitted around them, so that flat ground is flat and edges are straight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Int

from symbrion_gym._src.contact.planes import Planes


@dataclass(frozen=True)
class SnapConfig:
    """How vertices are moved onto planes.

    Attributes:
        max_move: a vertex moves by no more than this many tolerances: what lies farther off is no noise.
        anchor: weight of the place where a vertex was, against that of a plane: it fixes what planes leave open.
    """

    max_move: float = 3.0
    anchor: float = 1e-3


SNAP_DEFAULTS = SnapConfig()


def snap_to_planes(
    mesh: trimesh.Trimesh, planes: Planes, tolerance: float, config: SnapConfig = SNAP_DEFAULTS
) -> trimesh.Trimesh:
    """Return a mesh whose vertices lie on the planes of their faces: on one plane, its line with another, or
    a corner."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    vertex, label = _pair_vertices(np.asarray(mesh.faces), planes.labels)
    if not len(vertex):
        return mesh
    normals, offsets = planes.normals[label], planes.offsets[label]
    distance = np.abs(np.einsum("pi,pi->p", normals, vertices[vertex]) - offsets)
    is_near = distance <= config.max_move * tolerance
    vertex, normals, offsets = vertex[is_near], normals[is_near], offsets[is_near]
    # Least squares over the planes of a vertex and its old place: (sum n nT + a I) x = sum n d + a p.
    left = np.broadcast_to(config.anchor * np.eye(3), (len(vertices), 3, 3)).copy()
    right = config.anchor * vertices
    np.add.at(left, vertex, normals[:, :, None] * normals[:, None, :])
    np.add.at(right, vertex, normals * offsets[:, None])
    moved = np.linalg.solve(left, right[..., None])[..., 0]
    step = np.linalg.norm(moved - vertices, axis=1)
    is_far = step > config.max_move * tolerance
    moved[is_far] = vertices[is_far]
    return trimesh.Trimesh(moved, mesh.faces, process=False)


def _pair_vertices(
    faces: Int[np.ndarray, "F 3"], labels: Int[np.ndarray, " F"]
) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
    """Return every vertex with each plane of its faces, once."""
    vertex, label = faces.ravel(), np.repeat(labels, 3)
    has_plane = label >= 0
    pairs = np.unique(np.stack([vertex[has_plane], label[has_plane]], axis=1), axis=0)
    return pairs[:, 0], pairs[:, 1]
