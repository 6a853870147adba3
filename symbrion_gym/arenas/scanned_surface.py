"""Noisy triangle meshes of a known profile, such as a network makes of a scan: to try arena builders on.

The profile is rolled out flat, strewn with points and triangulated there, then rolled up again. So the
triangles know nothing of the edges: rims are chamfered and creases run through triangles, as in a real map.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import Delaunay, cKDTree


def make_scanned_surface(
    profile: np.ndarray,
    width: float = 2.0,
    num_vertices: int = 2200,
    noise: float = 0.002,
    seed: int = 0,
    is_grid: bool = False,
) -> trimesh.Trimesh:
    """Return a noisy open mesh of a profile drawn along y.

    Args:
        profile: `[P, 2]` the line (x, z) [m]; a vertical wall has the same x twice.
        width: extent along y [m].
        num_vertices: about how many vertices.
        noise: standard deviation of the vertices' places, in every direction [m].
        is_grid: a jittered grid, as a growing grid makes; else points strewn evenly, as a GSRM makes.
    """
    generator = np.random.default_rng(seed)
    steps = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    extent = np.array([along[-1], width])
    flat = (
        _strew(extent, num_vertices, generator) if not is_grid else _lay_grid(extent, num_vertices, generator)
    )
    x, z = (np.interp(flat[:, 0], along, profile[:, axis]) for axis in range(2))
    vertices = np.stack([x, flat[:, 1] - width / 2, z], axis=1)
    vertices += generator.normal(scale=noise, size=vertices.shape)
    triangles = Delaunay(flat).simplices
    a, b, c = (flat[triangles[:, i]] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return trimesh.Trimesh(vertices, triangles[np.abs(area) > 1e-9], process=False)


def cut_irregular(mesh: trimesh.Trimesh, yaw: float, seed: int = 0, depth: float = 0.15) -> trimesh.Trimesh:
    """Return the mesh turned about z by `yaw` [rad], its rim eaten in bites of up to `depth` [m]."""
    generator = np.random.default_rng(seed)
    centers = mesh.triangles_center[:, :2]
    low, high = mesh.bounds[:, :2]
    bites = generator.uniform(low, high, size=(24, 2))
    side = generator.integers(0, 4, size=24)
    bites[side == 0, 0], bites[side == 1, 0] = low[0], high[0]
    bites[side == 2, 1], bites[side == 3, 1] = low[1], high[1]
    radius = generator.uniform(0.3 * depth, depth, size=24)
    is_kept = (np.linalg.norm(centers[:, None] - bites[None], axis=2) > radius).all(axis=1)
    kept = trimesh.Trimesh(mesh.vertices, mesh.faces[is_kept], process=False)
    part = trimesh.graph.connected_component_labels(kept.face_adjacency, node_count=len(kept.faces))
    is_largest = part == np.bincount(part).argmax()
    largest = trimesh.Trimesh(mesh.vertices, kept.faces[is_largest], process=False)
    largest.remove_unreferenced_vertices()
    largest.apply_transform(trimesh.transformations.rotation_matrix(yaw, [0.0, 0.0, 1.0]))
    return largest


def _strew(extent: np.ndarray, count: int, generator: np.random.Generator) -> np.ndarray:
    """Random points, evened out by moving away from near neighbours; the rim is kept."""
    spacing = np.sqrt(extent.prod() / count)
    inner = generator.uniform(0.0, extent, size=(count, 2))
    for _ in range(12):
        distance, neighbor = cKDTree(inner).query(inner, k=4)
        away = inner[:, None] - inner[neighbor[:, 1:]]
        push = np.maximum(1.0 - distance[:, 1:] / spacing, 0.0) / np.maximum(distance[:, 1:], 1e-9)
        inner = np.clip(inner + 0.3 * spacing * np.sum(push[..., None] * away, axis=1), 0.0, extent)
    return np.unique(np.concatenate([inner, [[0, 0], [0, extent[1]], [extent[0], 0], extent]]), axis=0)


def _lay_grid(extent: np.ndarray, count: int, generator: np.random.Generator) -> np.ndarray:
    spacing = np.sqrt(extent.prod() / count)
    lines = [np.linspace(0.0, length, max(int(length / spacing), 2)) for length in extent]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    points[1:-1, 1:-1] += generator.normal(scale=0.12 * spacing, size=points[1:-1, 1:-1].shape)
    return points.reshape(-1, 2)
