"""Noisy triangle meshes of a known profile, such as a network makes of a scan: to try arena builders on.

The profile is unrolled, points are sampled and triangulated on it, then it is rolled up again. So the triangles
do not follow the edges: rims are chamfered and creases run through triangles, as in a real map.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import Delaunay, cKDTree

_RELAXATIONS, _STEP = 12, 0.3
"""Rounds in which points move apart, and how far in each, in spacings."""
_JITTER = 0.12
"""Standard deviation of a grid's inner points, in spacings."""
_LEAST_AREA = 1e-9
"""Triangles with less than half of this area are left out [m²]."""
_LEAST_DISTANCE = 1e-9
"""Keeps divisions by the distance of points at one place finite [m]."""


def make_scanned_surface(
    profile: Float[np.ndarray, "P 2"],
    width: float = 2.0,
    num_vertices: int = 2200,
    noise: float = 0.002,
    seed: int = 0,
    is_grid: bool = False,
) -> trimesh.Trimesh:
    """Return a noisy open mesh of a profile drawn along y."""
    rng = np.random.default_rng(seed)
    steps = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    extent = np.array([along[-1], width])
    sample = _sample_grid if is_grid else _sample_evenly
    flat = sample(extent, num_vertices, rng)
    x, z = (np.interp(flat[:, 0], along, profile[:, axis]) for axis in range(2))
    vertices = np.stack([x, flat[:, 1] - width / 2, z], axis=1)
    vertices += rng.normal(scale=noise, size=vertices.shape)
    triangles = Delaunay(flat).simplices
    a, b, c = (flat[triangles[:, i]] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return trimesh.Trimesh(vertices, triangles[np.abs(area) > _LEAST_AREA], process=False)


def cut_irregular(
    mesh: trimesh.Trimesh, yaw: float, seed: int = 0, depth: float = 0.15, num_bites: int = 24
) -> trimesh.Trimesh:
    """Return the mesh turned about z by `yaw` [rad], with random bites of up to `depth` [m] out of its rim."""
    rng = np.random.default_rng(seed)
    centers = mesh.triangles_center[:, :2]
    low, high = mesh.bounds[:, :2]
    bites = rng.uniform(low, high, size=(num_bites, 2))
    side = rng.integers(0, 4, size=num_bites)
    bites[side == 0, 0], bites[side == 1, 0] = low[0], high[0]
    bites[side == 2, 1], bites[side == 3, 1] = low[1], high[1]
    radius = rng.uniform(0.3 * depth, depth, size=num_bites)
    is_kept = (np.linalg.norm(centers[:, None] - bites[None], axis=2) > radius).all(axis=1)
    kept = trimesh.Trimesh(mesh.vertices, mesh.faces[is_kept], process=False)
    part = trimesh.graph.connected_component_labels(kept.face_adjacency, node_count=len(kept.faces))
    is_largest = part == np.bincount(part).argmax()
    largest = trimesh.Trimesh(mesh.vertices, kept.faces[is_largest], process=False)
    largest.remove_unreferenced_vertices()
    largest.apply_transform(trimesh.transformations.rotation_matrix(yaw, [0.0, 0.0, 1.0]))
    return largest


def _sample_evenly(
    extent: Float[np.ndarray, " 2"], count: int, rng: np.random.Generator
) -> Float[np.ndarray, "N 2"]:
    """Sample random points, evened out by moving away from near neighbors; the corners are among them."""
    spacing = np.sqrt(extent.prod() / count)
    inner = rng.uniform(0.0, extent, size=(count, 2))
    for _ in range(_RELAXATIONS):
        distance, neighbor = cKDTree(inner).query(inner, k=4)
        away = inner[:, None] - inner[neighbor[:, 1:]]
        push = np.maximum(1.0 - distance[:, 1:] / spacing, 0.0) / np.maximum(distance[:, 1:], _LEAST_DISTANCE)
        inner = np.clip(inner + _STEP * spacing * np.sum(push[..., None] * away, axis=1), 0.0, extent)
    return np.unique(np.concatenate([inner, [[0, 0], [0, extent[1]], [extent[0], 0], extent]]), axis=0)


def _sample_grid(
    extent: Float[np.ndarray, " 2"], count: int, rng: np.random.Generator
) -> Float[np.ndarray, "N 2"]:
    """Sample a grid, its inner points jittered."""
    spacing = np.sqrt(extent.prod() / count)
    lines = [np.linspace(0.0, length, max(int(length / spacing), 2)) for length in extent]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    points[1:-1, 1:-1] += rng.normal(scale=_JITTER * spacing, size=points[1:-1, 1:-1].shape)
    return points.reshape(-1, 2)
