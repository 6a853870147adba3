"""Where a terrain may be cut: lines in plan along creases, walls and steps."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from symbrion_gym.contact.planes import Planes

_SAME_WALL_DEG = 5.0
_WALL_REACH = 0.03
"""Lines this close to a wall all along it are taken for the wall [m]."""


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
    contacts = np.unique(sides[is_contact], axis=0)
    walls = [
        found
        for group in _group_walls(planes, contacts, steep)
        if (found := _line_of_wall(mesh, planes, group, edge_length)) is not None
    ]
    lines = []
    for first, second in contacts:
        contact = middles[is_contact & (sides[:, 0] == first) & (sides[:, 1] == second)]
        lines.append(_line_of_crease(planes, first, second, contact, 3.0 * edge_length))
        if min(planes.normals[first, 2], planes.normals[second, 2]) >= steep:
            is_part = (labels == first) | (labels == second)
            lines.append(_line_of_step(mesh, planes, first, second, is_part, contact, 2.0 * edge_length))
    found = [line for line in lines if line is not None and not _is_beside_wall(line, walls)]
    return _drop_repeated(np.array([line for line, _ in walls] + found).reshape(-1, 3))


def _group_walls(planes: Planes, contacts: np.ndarray, steep: float) -> list[np.ndarray]:
    """Planes of walls, those together that touch and face the same way: noise parts one wall into several."""
    is_wall = planes.normals[:, 2] < steep
    count = len(planes.normals)
    first, second = contacts[is_wall[contacts].all(axis=1)].T
    rise = np.linalg.norm(planes.normals[:, :2], axis=1)
    facing = np.einsum("ci,ci->c", planes.normals[first, :2], planes.normals[second, :2])
    is_same = facing > np.cos(np.radians(_SAME_WALL_DEG)) * rise[first] * rise[second]
    links = csr_matrix((np.ones(is_same.sum()), (first[is_same], second[is_same])), shape=(count, count))
    _, group = connected_components(links, directed=False)
    return [np.flatnonzero(is_wall & (group == k)) for k in np.unique(group[is_wall])]


def _line_of_wall(
    mesh: trimesh.Trimesh, planes: Planes, group: np.ndarray, edge_length: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """The line of a wall at the middle of its height, where neither foot nor rim is rounded; and its ends."""
    members = np.isin(planes.labels, group)
    areas = np.asarray(mesh.area_faces)[members]
    facing = areas @ np.asarray(mesh.face_normals)[members] if len(areas) else np.zeros(3)
    size = np.hypot(facing[0], facing[1])
    if size < 0.5 * areas.sum() or areas.sum() <= 0:
        return None
    normal = facing[:2] / size
    line = np.append(normal, areas @ np.asarray(mesh.triangles_center)[members, :2] @ normal / areas.sum())
    corners = np.asarray(mesh.triangles)[members]
    along = corners[:, :, :2].reshape(-1, 2) @ [-normal[1], normal[0]]
    low, high = np.quantile(corners[:, :, 2], [0.02, 0.98])
    reach = max(edge_length, _WALL_REACH)
    centers = np.asarray(mesh.triangles_center)[:, :2]
    run = centers @ [-normal[1], normal[0]]
    is_part = (np.abs(centers @ normal - line[2]) < reach) & (run > along.min()) & (run < along.max())
    is_part &= np.asarray(mesh.face_normals)[:, :2] @ normal > 0.5
    edges = np.unique(np.sort(mesh.faces[is_part][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    start, end = np.asarray(mesh.vertices)[edges[:, 0]], np.asarray(mesh.vertices)[edges[:, 1]]
    points = []
    for level in low + (high - low) * np.array([0.4, 0.5, 0.6]):
        crosses = (start[:, 2] - level) * (end[:, 2] - level) < 0
        share = (level - start[crosses, 2]) / (end[crosses, 2] - start[crosses, 2])
        points.append(start[crosses, :2] + share[:, None] * (end[crosses, :2] - start[crosses, :2]))
    points = np.concatenate(points)
    if len(points) >= 12 and np.ptp(points @ [-normal[1], normal[0]]) > 4.0 * edge_length:
        line = _fit_line(points)
    direction = np.array([-line[1], line[0]])
    ends = np.quantile(corners[:, :, :2].reshape(-1, 2) @ direction, [0.0, 1.0])
    return line, line[2] * line[:2] + ends[:, None] * direction


def _is_beside_wall(line: np.ndarray, walls: list[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether a line is that of a wall, less well known: nowhere along the wall far from it."""
    return any(np.abs(ends @ line[:2] - line[2]).max() < _WALL_REACH for _, ends in walls)


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
