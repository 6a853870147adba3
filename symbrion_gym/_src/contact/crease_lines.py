"""Where a terrain may be cut: lines in plan along creases, walls and steps."""

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.halfspaces import STEEP
from symbrion_gym._src.contact.planes import Planes

_CREASE_REACH = 3.0  # A crease lies this close to the edges where its planes touch, in median edges
_STEP_REACH = 2.0  # Likewise, the points of a step
_ROUNDS = 6  # Number of rounds of robust line fits
_LEAST_CROSSING = 0.01
"""Planes that meet at a smaller angle (sine, in plan) have no line in plan that is worth its noise."""
_SAME_LINE = 1e-4  # Lines whose coefficients differ by less are one
_LEAST_GAP = 1e-6  # Keeps the scale of a robust fit above zero [m]


def find_crease_lines(mesh: trimesh.Trimesh, planes: Planes) -> Float[np.ndarray, "C 3"]:
    """Find lines in plan (a x + b y = c) along which the terrain may be cut: walls, creases, steps."""
    labels = _fill_labels(mesh, planes.labels)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    sides = np.sort(labels[pairs], axis=1)
    is_contact = (sides[:, 0] != sides[:, 1]) & (sides[:, 0] >= 0)
    middles = np.asarray(mesh.vertices)[np.asarray(mesh.face_adjacency_edges).reshape(-1, 2)].mean(axis=1)
    edge_length = float(np.median(mesh.edges_unique_length))
    lines = [_find_wall(mesh, planes, int(k)) for k in np.flatnonzero(planes.normals[:, 2] < STEEP)]
    for first, second in np.unique(sides[is_contact], axis=0):
        contact = middles[is_contact & (sides[:, 0] == first) & (sides[:, 1] == second)]
        crease = _find_crease(planes, first, second, contact, _CREASE_REACH * edge_length)
        lines += [] if crease is None else [crease]
        if min(planes.normals[first, 2], planes.normals[second, 2]) >= STEEP:
            points = _find_step(mesh, planes, first, second, (labels == first) | (labels == second))
            distance, _ = cKDTree(contact[:, :2]).query(points)
            points = points[distance < _STEP_REACH * edge_length]
            lines += [_fit_line(points)] if len(points) >= 3 else []
    return _drop_repeated(lines)


def _fill_labels(mesh: trimesh.Trimesh, labels: Int[np.ndarray, " F"]) -> Int[np.ndarray, " F"]:
    """Give every face without a plane the label of the nearest face that has one, in steps over edges."""
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    labels = labels.copy()
    while True:
        is_next = (labels[pairs[:, 0]] >= 0) & (labels[pairs[:, 1]] < 0)
        if not is_next.any():
            return labels
        labels[pairs[is_next, 1]] = labels[pairs[is_next, 0]]


def _find_wall(mesh: trimesh.Trimesh, planes: Planes, wall: int) -> Float[np.ndarray, " 3"]:
    """Return the line of a wall at its mean height, where neither foot nor rim is rounded."""
    areas = np.where(planes.labels == wall, mesh.area_faces, 0.0)
    height = areas @ np.asarray(mesh.triangles_center)[:, 2] / areas.sum()
    normal = planes.normals[wall]
    return np.append(normal[:2], planes.offsets[wall] - normal[2] * height) / np.hypot(normal[0], normal[1])


def _find_crease(
    planes: Planes, first: int, second: int, contact: Float[np.ndarray, "N 3"], reach: float
) -> Float[np.ndarray, " 3"] | None:
    """Return the line in plan where two planes meet, if that is where their faces meet."""
    normals, offsets = planes.normals[[first, second]], planes.offsets[[first, second]]
    # z taken out of n1·p = d1 and n2·p = d2.
    line = np.append(
        normals[0, :2] * normals[1, 2] - normals[1, :2] * normals[0, 2],
        offsets[0] * normals[1, 2] - offsets[1] * normals[0, 2],
    )
    size = np.hypot(line[0], line[1])
    if size < _LEAST_CROSSING:
        return None
    line /= size
    return line if np.median(np.abs(contact[:, :2] @ line[:2] - line[2])) < reach else None


def _find_step(
    mesh: trimesh.Trimesh, planes: Planes, first: int, second: int, is_part: Bool[np.ndarray, " F"]
) -> Float[np.ndarray, "N 2"]:
    """Return the points in plan where edges are half way up from one plane to the other."""
    edges = np.unique(np.sort(mesh.faces[is_part][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    vertices = np.asarray(mesh.vertices)
    heights = [
        (planes.offsets[k] - vertices[:, :2] @ planes.normals[k, :2]) / planes.normals[k, 2]
        for k in (first, second)
    ]
    above = vertices[:, 2] - (heights[0] + heights[1]) / 2
    start, end = above[edges[:, 0]], above[edges[:, 1]]
    is_crossing = start * end < 0
    share = start[is_crossing] / (start[is_crossing] - end[is_crossing])
    a, b = (vertices[edges[is_crossing, i], :2] for i in range(2))
    return a + share[:, None] * (b - a)


def _fit_line(points: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, " 3"]:
    """Fit a line to points: total least squares, far points losing weight."""
    weights = np.ones(len(points))
    line = np.zeros(3)
    for _ in range(_ROUNDS):
        center = weights @ points / weights.sum()
        spread = (points - center).T * weights @ (points - center)
        normal = np.linalg.eigh(spread)[1][:, 0]
        line = np.append(normal, normal @ center)
        gap = np.abs(points @ normal - line[2])
        # About 1.5 medians are a standard deviation of normal noise.
        scale = max(1.5 * float(np.median(gap)), _LEAST_GAP)
        weights = 1.0 / np.maximum(gap / scale, 1.0) ** 2
    return line


def _drop_repeated(lines: list[np.ndarray]) -> Float[np.ndarray, "D 3"]:
    kept: list[np.ndarray] = []
    for line in lines:
        signs = [np.sign(other[:2] @ line[:2]) or 1.0 for other in kept]
        if all(np.abs(line - s * other).max() > _SAME_LINE for s, other in zip(signs, kept, strict=True)):
            kept.append(line)
    return np.array(kept).reshape(-1, 3)
