"""Moments of the faces of a mesh, and the planes that fit sums of them best: noise averages out over a region.

References:
    Cohen-Steiner, Alliez, Desbrun (2004), Variational shape approximation, section 3: moments of triangles.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float, Int

_LEAST_MASS = 1e-300
"""Keeps divisions by the area of no faces finite."""


def find_moments(mesh: trimesh.Trimesh, origin: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "F 4 4"]:
    """Return the integral of h hᵀ over every face, h = (x - origin, 1)."""
    corners = np.asarray(mesh.triangles, dtype=np.float64) - origin
    homogeneous = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    total = homogeneous.sum(axis=1)
    # Over a triangle of area A it is A/12 (sum of h hᵀ over the corners + s sᵀ), s the sum of their h.
    moments = np.einsum("fki,fkj->fij", homogeneous, homogeneous) + total[:, :, None] * total[:, None, :]
    return moments * (np.asarray(mesh.area_faces, dtype=np.float64)[:, None, None] / 12.0)


def fit_planes(
    moments: Float[np.ndarray, "*N 4 4"],
) -> tuple[Float[np.ndarray, "*N 3"], Float[np.ndarray, " *N"], Float[np.ndarray, " *N"]]:
    """Return least-squares planes of moments: normals of either sign, offsets and standard deviations [m]."""
    mass = np.maximum(moments[..., 3, 3], _LEAST_MASS)
    center = moments[..., :3, 3] / mass[..., None]
    spread = moments[..., :3, :3] / mass[..., None, None] - center[..., :, None] * center[..., None, :]
    values, vectors = np.linalg.eigh(spread)
    normal = vectors[..., 0]
    offset = np.asarray(np.sum(normal * center, axis=-1))
    return normal, offset, np.asarray(np.sqrt(np.maximum(values[..., 0], 0.0)))


def measure_deviations(
    moments: Float[np.ndarray, "N 4 4"], normal: Float[np.ndarray, " 3"], offset: float
) -> Float[np.ndarray, " N"]:
    """Return root-mean-square distances of moments from one plane [m]."""
    plane = np.append(normal, -offset)
    square = np.einsum("nij,i,j->n", moments, plane, plane)
    return np.sqrt(np.maximum(square, 0.0) / np.maximum(moments[:, 3, 3], _LEAST_MASS))


def weigh_faces(
    labels: Int[np.ndarray, " F"], pairs: Int[np.ndarray, "P 2"], border_weight: float
) -> Float[np.ndarray, " F"]:
    """Return how much each face counts in the plane of its region: little at the border, not at all without one."""
    weights = np.ones(len(labels))
    weights[pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]].ravel()] = border_weight
    return weights * (labels >= 0)
