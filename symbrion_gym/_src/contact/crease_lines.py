"""Where a terrain may be cut: lines in plan along creases, walls and steps."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import (
    STEEP,
    compute_halfspaces,
    compute_tops,
    find_box,
    make_solid,
)
from reconstruction._src.geometry.rows import make_hull
from reconstruction._src.geometry.sampling import sample_grid
from symbrion_gym._src.contact.planes import Planes

_SAME_WALL_DEG = 5.0
"""Walls that touch and face directions this close are one: noise parts a wall into several."""
_WALL_REACH = 0.03  # Lines this close to a wall all along it are taken for the wall [m]
_WALL_FACING = 0.5
"""The faces of a wall sum to this share of their area in plan; else it has no one direction."""
_WALL_COSINE = 0.5
"""Faces at the wall whose normals are within the angle of this cosine (60 degrees) belong to it."""
_WALL_LEVELS = (0.4, 0.5, 0.6)
"""Shares of the height of a wall at which its line is measured, away from a rounded foot and rim."""
_WALL_TRIM = 0.02  # Share of the corners of a wall that its height leaves out, at the foot and at the rim
_MIN_CROSSINGS = 12  # Points that a line along the middle of a wall is fitted to, at least
_MIN_WALL = 4.0  # Length of such a line, in median edges, at least
_CREASE_REACH = 3.0  # A crease lies this close to the edges where its planes touch, in median edges
_STEP_REACH = 2.0  # Likewise, the points of a step
_ROUNDS = 6  # Number of rounds of robust line fits


_LEAST_CROSSING = 0.01
"""Planes that meet at a smaller angle (sine, in plan) have no line in plan that is worth its noise."""
_SAME_LINE = 1e-4  # Lines whose coefficients differ by less are one
_LEAST_GAP = 1e-6  # Keeps the scale of a robust fit above zero [m]


def fill_labels(mesh: trimesh.Trimesh, labels: Int[np.ndarray, " F"]) -> Int[np.ndarray, " F"]:
    """Give every face without a plane the label of the nearest face that has one, in steps over edges."""
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    labels = labels.copy()
    while True:
        is_next = (labels[pairs[:, 0]] >= 0) & (labels[pairs[:, 1]] < 0)
        if not is_next.any():
            return labels
        labels[pairs[is_next, 1]] = labels[pairs[is_next, 0]]


def find_crease_lines(mesh: trimesh.Trimesh, planes: Planes, steep: float) -> Float[np.ndarray, "C 3"]:
    """Find lines in plan along which the terrain may be cut."""
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
        if (found := _fit_wall(mesh, planes, group, edge_length)) is not None
    ]
    lines = []
    for first, second in contacts:
        contact = middles[is_contact & (sides[:, 0] == first) & (sides[:, 1] == second)]
        lines.append(_find_crease(planes, first, second, contact, _CREASE_REACH * edge_length))
        if min(planes.normals[first, 2], planes.normals[second, 2]) >= steep:
            is_part = (labels == first) | (labels == second)
            points = _find_step(mesh, planes, first, second, is_part)
            distance, _ = cKDTree(contact[:, :2]).query(points)
            points = points[distance < _STEP_REACH * edge_length]
            lines.append(_fit_line(points, _ROUNDS) if len(points) >= 3 else None)
    found = [line for line in lines if line is not None and not _is_near_wall(line, walls, _WALL_REACH)]
    return _drop_repeated(np.array([line for line, _ in walls] + found).reshape(-1, 3))


def _group_walls(
    planes: Planes, contacts: Int[np.ndarray, "C 2"], steep: float
) -> list[Int[np.ndarray, " G"]]:
    """Return the planes of walls, those together that touch and face the same way."""
    is_wall = planes.normals[:, 2] < steep
    count = len(planes.normals)
    first, second = contacts[is_wall[contacts].all(axis=1)].T
    rise = np.linalg.norm(planes.normals[:, :2], axis=1)
    facing = np.einsum("ci,ci->c", planes.normals[first, :2], planes.normals[second, :2])
    is_same = facing > np.cos(np.radians(_SAME_WALL_DEG)) * rise[first] * rise[second]
    links = csr_matrix((np.ones(is_same.sum()), (first[is_same], second[is_same])), shape=(count, count))
    _, group = connected_components(links, directed=False)
    return [np.flatnonzero(is_wall & (group == k)) for k in np.unique(group[is_wall])]


def _fit_wall(
    mesh: trimesh.Trimesh,
    planes: Planes,
    group: Int[np.ndarray, " G"],
    edge_length: float,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "2 2"]] | None:
    """Return the line of a wall at the middle of its height, where neither foot nor rim is rounded; and its ends."""
    members = np.isin(planes.labels, group)
    areas = np.asarray(mesh.area_faces)[members]
    facing = areas @ np.asarray(mesh.face_normals)[members] if len(areas) else np.zeros(3)
    size = np.hypot(facing[0], facing[1])
    if size < _WALL_FACING * areas.sum() or areas.sum() <= 0:
        return None
    normal = facing[:2] / size
    line = np.append(normal, areas @ np.asarray(mesh.triangles_center)[members, :2] @ normal / areas.sum())
    corners = np.asarray(mesh.triangles)[members]
    along = corners[:, :, :2].reshape(-1, 2) @ [-normal[1], normal[0]]
    low, high = np.quantile(corners[:, :, 2], [_WALL_TRIM, 1.0 - _WALL_TRIM])
    reach = max(edge_length, _WALL_REACH)
    centers = np.asarray(mesh.triangles_center)[:, :2]
    run = centers @ [-normal[1], normal[0]]
    is_part = (np.abs(centers @ normal - line[2]) < reach) & (run > along.min()) & (run < along.max())
    is_part &= np.asarray(mesh.face_normals)[:, :2] @ normal > _WALL_COSINE
    points = _find_contours(mesh, is_part, low + (high - low) * np.array(_WALL_LEVELS))
    run = points @ [-normal[1], normal[0]]
    if len(points) >= _MIN_CROSSINGS and np.ptp(run) > _MIN_WALL * edge_length:
        line = _fit_line(points, _ROUNDS)
    direction = np.array([-line[1], line[0]])
    ends = np.quantile(corners[:, :, :2].reshape(-1, 2) @ direction, [0.0, 1.0])
    return line, line[2] * line[:2] + ends[:, None] * direction


def _find_edges(mesh: trimesh.Trimesh, is_part: Bool[np.ndarray, " F"]) -> Int[np.ndarray, "E 2"]:
    """Return the edges of some faces, each once."""
    return np.unique(np.sort(mesh.faces[is_part][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def _find_contours(
    mesh: trimesh.Trimesh, is_part: Bool[np.ndarray, " F"], levels: Float[np.ndarray, " L"]
) -> Float[np.ndarray, "N 2"]:
    """Return the points in plan where edges of some faces pass through levels."""
    edges = _find_edges(mesh, is_part)
    start, end = np.asarray(mesh.vertices)[edges[:, 0]], np.asarray(mesh.vertices)[edges[:, 1]]
    points = []
    for level in levels:
        crosses = (start[:, 2] - level) * (end[:, 2] - level) < 0
        share = (level - start[crosses, 2]) / (end[crosses, 2] - start[crosses, 2])
        points.append(start[crosses, :2] + share[:, None] * (end[crosses, :2] - start[crosses, :2]))
    return np.concatenate(points)


def _is_near_wall(
    line: Float[np.ndarray, " 3"],
    walls: list[tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "2 2"]]],
    reach: float,
) -> bool:
    """Return whether a line is that of a wall, less well known: nowhere along the wall far from it."""
    return any(np.abs(ends @ line[:2] - line[2]).max() < reach for _, ends in walls)


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
    edges = _find_edges(mesh, is_part)
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


def _fit_line(points: Float[np.ndarray, "N 2"], rounds: int) -> Float[np.ndarray, " 3"]:
    """Fit a line to points: total least squares, far points losing weight."""
    weights = np.ones(len(points))
    line = np.zeros(3)
    for _ in range(rounds):
        center = weights @ points / weights.sum()
        spread = (points - center).T * weights @ (points - center)
        normal = np.linalg.eigh(spread)[1][:, 0]
        line = np.append(normal, normal @ center)
        gap = np.abs(points @ normal - line[2])
        # About 1.5 medians are a standard deviation of normal noise.
        scale = max(1.5 * float(np.median(gap)), _LEAST_GAP)
        weights = 1.0 / np.maximum(gap / scale, 1.0) ** 2
    return line


def _drop_repeated(lines: Float[np.ndarray, "C 3"]) -> Float[np.ndarray, "D 3"]:
    kept: list[np.ndarray] = []
    for line in lines:
        signs = [np.sign(other[:2] @ line[:2]) or 1.0 for other in kept]
        if all(np.abs(line - s * other).max() > _SAME_LINE for s, other in zip(signs, kept, strict=True)):
            kept.append(line)
    return np.array(kept).reshape(-1, 3)


_ON_FACE = 1e-4  # Corners this close to a plane belong to its face [m]
_SAME_SIDE = 1e-4  # Planes whose coefficients differ by less are one: corners are rounded to 1 µm


_CLEARANCE = 5e-4
"""A hidden edge lies this far beneath the plane that bodies come from [m]: more than they sink in, and less
than a body feels."""
_MAX_MOVE = 0.01  # An end moves by no more than this [m]: on planes that hardly bend it would leave a gap
_REACH = 3e-3  # Edges this close to another piece are hidden by it [m]: boxes stand out by as much
_EDGE_POINTS = 9  # Points along an edge that are looked at
_LIFT = 2e-4  # Ground lowered by less is not lowered, when a piece is left out [m]
_PIECE_POINTS = 160  # Points a side of the grid on which a piece is looked at


def clear_hidden_edges(pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    """Return pieces without those that are hidden, whose hidden ends stop short of crests."""
    kept = _drop_hidden(pieces, ground)
    halfspaces = [compute_halfspaces(piece) for piece in kept]
    return [_shorten(i, kept, halfspaces) for i in range(len(kept))]


def _drop_hidden(pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    """Return the pieces, without those whose tops lie beneath others wherever there is ground, the smallest first."""
    halfspaces = {i: compute_halfspaces(piece) for i, piece in enumerate(pieces)}
    for i in sorted(halfspaces, key=lambda i: float(pieces[i].volume)):
        points = sample_grid(np.asarray(pieces[i].vertices), _PIECE_POINTS)
        points = points[np.isfinite(ground.height(*points.T))]
        own = compute_tops(halfspaces[i], points)
        others = [compute_tops(planes, points) for k, planes in halfspaces.items() if k != i]
        if others and (own <= np.max(others, axis=0) + _LIFT).all():
            del halfspaces[i]
    return [pieces[i] for i in sorted(halfspaces)]


def _shorten(
    i: int, pieces: list[trimesh.Trimesh], halfspaces: list[Float[np.ndarray, "H 4"]]
) -> trimesh.Trimesh:
    """Return a piece whose ends stop short of the crests that it has in common with other pieces."""
    piece, planes = pieces[i], halfspaces[i]
    corners = np.asarray(piece.vertices)
    for side in planes[planes[:, 2] <= STEEP]:
        moves = [0.0]
        for top in planes[planes[:, 2] > STEEP]:
            ends = _find_edge(corners, side, top)
            if ends is None:
                continue
            others = (other for j, other in enumerate(halfspaces) if j != i)
            moves += [_find_move(ends, side, top, other) for other in others]
        move = max(moves) or min(moves)
        if move:
            piece = _move_side(piece, side, move)
    return piece


def _move_side(piece: trimesh.Trimesh, side: Float[np.ndarray, " 4"], move: float) -> trimesh.Trimesh:
    """Return a piece with a side moved inwards, or outwards below 0 [m]; the piece itself where that is no solid."""
    corners = np.asarray(piece.vertices)
    if find_box(piece) is not None:  # stays a box to the last digit
        is_side = np.abs(corners @ side[:3] + side[3]) < _ON_FACE
        made = make_hull(corners - is_side[:, None] * (move * side[:3]))
    else:
        moved = compute_halfspaces(piece)
        moved[np.abs(moved - side).max(axis=1) < _SAME_SIDE, 3] += move
        made = make_solid(moved, corners.mean(axis=0))
    return piece if made is None else made


def _find_edge(
    corners: Float[np.ndarray, "V 3"], side: Float[np.ndarray, " 4"], top: Float[np.ndarray, " 4"]
) -> Float[np.ndarray, "2 3"] | None:
    """Return the ends of the edge between a side and a top; None where they have none."""
    is_on = (np.abs(corners @ side[:3] + side[3]) < _ON_FACE) & (
        np.abs(corners @ top[:3] + top[3]) < _ON_FACE
    )
    if is_on.sum() < 2:
        return None
    edge = corners[is_on]
    along = edge @ np.cross(side[:3], top[:3])
    return edge[[int(along.argmin()), int(along.argmax())]]


def _find_move(
    ends: Float[np.ndarray, "2 3"],
    side: Float[np.ndarray, " 4"],
    top: Float[np.ndarray, " 4"],
    other: Float[np.ndarray, "H 4"],
) -> float:
    """Return how far a side moves until its upper edge is clear of another piece's tops [m].

    Above 0 inwards, from a crest; below 0 outwards, where the edge ends at the foot of a slope; 0 where it may stay.
    """
    share = np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None]
    points = (1.0 - share) * ends[0] + share * ends[1]
    inwards = -side[:3] + (side[:3] @ top[:3]) * top[:3]
    inwards /= np.linalg.norm(inwards)
    is_top = other[:, 2] > STEEP
    around = other[~is_top]
    is_near = (points @ around[:, :3].T + around[:, 3]).max(axis=1) < _REACH
    moves = [0.0]
    for plane in other[is_top]:
        heights = (points @ plane[:3] + plane[3])[is_near]
        fall = -float(plane[:3] @ inwards)
        if not len(heights) or fall == 0 or np.abs(heights).max() > _REACH:
            continue
        move = max(float(heights.max()) + _CLEARANCE, 0.0) / fall * -float(side[:3] @ inwards)
        if abs(move) <= _MAX_MOVE:
            moves.append(move)
    return max(moves) or min(moves)
