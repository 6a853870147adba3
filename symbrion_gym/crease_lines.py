"""Where a terrain may be cut: lines in plan along creases, walls and steps."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from symbrion_gym.planes import Planes


def fill_labels(mesh: trimesh.Trimesh, labels: np.ndarray) -> np.ndarray:
    """Give every face without a plane the label of the nearest face that has one, in steps over edges."""
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    labels = labels.copy()
    while True:
        is_next = (labels[pairs[:, 0]] >= 0) & (labels[pairs[:, 1]] < 0)
        if not is_next.any():
            return labels
        labels[pairs[is_next, 1]] = labels[pairs[is_next, 0]]


def find_crease_lines(mesh: trimesh.Trimesh, planes: Planes, steep: float) -> np.ndarray:
    """Find lines in plan along which the terrain may be cut.

    Args:
        mesh: open terrain.
        planes: its planes.
        steep: planes whose normal rises less than this are walls.

    Returns:
        `[C, 3]` lines (a, b, c) with a x + b y = c and a² + b² = 1.
    """
    labels = fill_labels(mesh, planes.labels)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    sides = np.sort(labels[pairs], axis=1)
    is_contact = (sides[:, 0] != sides[:, 1]) & (sides[:, 0] >= 0)
    middles = np.asarray(mesh.vertices)[np.asarray(mesh.face_adjacency_edges).reshape(-1, 2)].mean(axis=1)
    edge_length = float(np.median(mesh.edges_unique_length))
    lines = [
        _line_of_wall(mesh, planes, k) for k in range(len(planes.normals)) if planes.normals[k, 2] < steep
    ]
    for first, second in np.unique(sides[is_contact], axis=0):
        contact = middles[is_contact & (sides[:, 0] == first) & (sides[:, 1] == second)]
        lines.append(_line_of_crease(planes, first, second, contact, 3.0 * edge_length))
        if min(planes.normals[first, 2], planes.normals[second, 2]) >= steep:
            is_part = (labels == first) | (labels == second)
            lines.append(_line_of_step(mesh, planes, first, second, is_part, contact, 2.0 * edge_length))
    found = np.array([line for line in lines if line is not None]).reshape(-1, 3)
    return _drop_repeated(found)


def _line_of_wall(mesh: trimesh.Trimesh, planes: Planes, wall: int) -> np.ndarray | None:
    normal = planes.normals[wall]
    rise = np.hypot(normal[0], normal[1])
    members = planes.labels == wall
    areas = mesh.area_faces[members]
    if rise < 0.5 or areas.sum() <= 0:
        return None
    middle = areas @ mesh.triangles_center[members] / areas.sum()
    return np.array([*normal[:2] / rise, middle[:2] @ normal[:2] / rise])


def _line_of_crease(
    planes: Planes, first: int, second: int, contact: np.ndarray, reach: float
) -> np.ndarray | None:
    """The line in plan where two planes meet, if that is where their faces meet."""
    normals, offsets = planes.normals[[first, second]], planes.offsets[[first, second]]
    # z taken out of n1·p = d1 and n2·p = d2.
    line = np.append(
        normals[0, :2] * normals[1, 2] - normals[1, :2] * normals[0, 2],
        offsets[0] * normals[1, 2] - offsets[1] * normals[0, 2],
    )
    size = np.hypot(line[0], line[1])
    if size < 0.01:
        return None
    line /= size
    return line if np.median(np.abs(contact[:, :2] @ line[:2] - line[2])) < reach else None


def _line_of_step(
    mesh: trimesh.Trimesh,
    planes: Planes,
    first: int,
    second: int,
    is_part: np.ndarray,
    contact: np.ndarray,
    reach: float,
) -> np.ndarray | None:
    """A line through the places where the mesh is half way up from one plane to the other."""
    edges = np.sort(mesh.faces[is_part][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = np.unique(edges, axis=0)
    vertices = np.asarray(mesh.vertices)
    heights = [
        (planes.offsets[k] - vertices[:, :2] @ planes.normals[k, :2]) / planes.normals[k, 2]
        for k in (first, second)
    ]
    above = vertices[:, 2] - (heights[0] + heights[1]) / 2
    start, end = above[edges[:, 0]], above[edges[:, 1]]
    is_crossing = start * end < 0
    if is_crossing.sum() < 3:
        return None
    share = start[is_crossing] / (start[is_crossing] - end[is_crossing])
    a, b = (vertices[edges[is_crossing, i], :2] for i in range(2))
    points = a + share[:, None] * (b - a)
    distance, _ = cKDTree(contact[:, :2]).query(points)
    points = points[distance < reach]
    return _fit_line(points) if len(points) >= 3 else None


def _fit_line(points: np.ndarray) -> np.ndarray:
    """Robust line through points `[N, 2]`: total least squares, far points losing weight."""
    weights = np.ones(len(points))
    line = np.zeros(3)
    for _ in range(6):
        center = weights @ points / weights.sum()
        spread = (points - center).T * weights @ (points - center)
        normal = np.linalg.eigh(spread)[1][:, 0]
        line = np.append(normal, normal @ center)
        gap = np.abs(points @ normal - line[2])
        scale = max(1.5 * float(np.median(gap)), 1e-6)
        weights = 1.0 / np.maximum(gap / scale, 1.0) ** 2
    return line


def _drop_repeated(lines: np.ndarray) -> np.ndarray:
    kept: list[np.ndarray] = []
    for line in lines:
        signs = [np.sign(other[:2] @ line[:2]) or 1.0 for other in kept]
        if all(np.abs(line - s * other).max() > 1e-4 for s, other in zip(signs, kept, strict=True)):
            kept.append(line)
    return np.array(kept).reshape(-1, 3)
