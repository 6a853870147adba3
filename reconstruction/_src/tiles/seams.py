"""Where tiles meet: surfaces are cut at the border, moved onto the mean of the neighbors, and get the same vertices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.tiles.point_stream import TilesConfig

_ON_BORDER = 1e-9  # A vertex this near to a border lies on it [m]
_LEAST_SQUARE = 1e-30  # Squared length of an edge without length [m²]
_STEEP = 4.0
"""Where the nearest place of a curve is this many times nearer than the one straight above or below, it counts: beyond
76 degrees, curves of two tiles that are a little apart in plan are far apart in height."""


class Surface(NamedTuple):
    """Vertices [m] and faces of a surface."""

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]


class Border(NamedTuple):
    """One side of a tile."""

    axis: int  # 0 for a border of constant x, 1 for one of constant y
    value: float  # that coordinate [m]


def join_tile(
    own: Surface,
    neighbors: Mapping[tuple[int, int], Surface],
    place: tuple[int, int],
    config: TilesConfig,
) -> Surface:
    """Return the surface of a tile, cut at its borders, without a step to its neighbors.

    In the halo, a vertex moves towards the mean of its tile's surface and those of the neighbors; at the border it lies
    on that mean. Both sides of a border get the vertices of both, at the same places.
    """
    max_gap = config.max_gap * config.width
    cut = clip(own, place, config.tile)
    if not len(cut.faces):
        return cut
    curves: dict[Border, Surface] = {}
    for shift, neighbor in sorted(neighbors.items()):
        if 0 in shift:
            axis, step = (0, shift[0]) if shift[0] else (1, shift[1])
            border = Border(axis, (place[axis] + (step > 0)) * config.tile)
            curves[border] = clip(neighbor, (place[0] + shift[0], place[1] + shift[1]), config.tile)
    partners: dict[bytes, Float[np.ndarray, " 3"]] = {}
    for border, curve in curves.items():
        cut = _insert_vertices(cut, border, curve, max_gap, partners)
    moved = _blend(cut.vertices, neighbors, place, config, max_gap)
    for border, curve in curves.items():
        moved = _meet(cut, moved, border, curve, max_gap, partners)
    surfaces = {(0, 0): own, **neighbors}
    return Surface(_meet_corners(cut.vertices, moved, surfaces, place, config.tile, max_gap), cut.faces)


def clip(surface: Surface, place: tuple[int, int], tile: float) -> Surface:
    """Cut off what is outside of a tile in plan."""
    for axis in (0, 1):
        for sign, number in ((1.0, place[axis]), (-1.0, place[axis] + 1)):
            surface = _cut(surface, axis, sign, number * tile)
    return surface


def _cut(surface: Surface, axis: int, sign: float, value: float) -> Surface:
    """Cut off the side where sign x (coordinate - value) is below 0; new vertices lie exactly on the border."""
    vertices, faces = surface
    beyond = sign * (vertices[:, axis] - value)
    beyond[np.abs(beyond) <= _ON_BORDER] = 0.0
    inside = (beyond >= 0)[faces].sum(axis=1)
    kept = faces[(inside == 3) & (beyond[faces] > 0).any(axis=1)]
    parts, new = [kept], []
    count = len(vertices)
    for wanted in (1, 2):
        mixed = faces[inside == wanted]
        # Rolled so that the odd corner is first: the one inside, or the one outside.
        odd = ((beyond[mixed] >= 0) == (wanted == 1)).argmax(axis=1)
        mixed = mixed[np.arange(len(mixed))[:, None], (odd[:, None] + np.arange(3)) % 3]
        places = [_cross(vertices, beyond, mixed[:, 0], mixed[:, i], axis, value) for i in (1, 2)]
        first, second = (count + i * len(mixed) + np.arange(len(mixed)) for i in (0, 1))
        count += 2 * len(mixed)
        new += places
        if wanted == 1:
            parts.append(np.stack([mixed[:, 0], first, second], axis=1))
        else:
            parts.append(np.stack([first, mixed[:, 1], mixed[:, 2]], axis=1))
            parts.append(np.stack([first, mixed[:, 2], second], axis=1))
    return _weld(Surface(np.concatenate([vertices, *new]), np.concatenate(parts)))


def _cross(
    vertices: Float[np.ndarray, "V 3"],
    beyond: Float[np.ndarray, " V"],
    begin: Int[np.ndarray, " F"],
    end: Int[np.ndarray, " F"],
    axis: int,
    value: float,
) -> Float[np.ndarray, "F 3"]:
    """Return where edges cross a border; an edge gives the same place from both of its faces."""
    begin, end = np.minimum(begin, end), np.maximum(begin, end)
    share = beyond[begin] / (beyond[begin] - beyond[end])
    place = vertices[begin] + share[:, None] * (vertices[end] - vertices[begin])
    place[:, axis] = value
    return place


def _weld(surface: Surface) -> Surface:
    """Join vertices at one place, and drop faces without area and vertices without face."""
    vertices, numbers = np.unique(surface.vertices, axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[surface.faces]
    is_face = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    used, faces = np.unique(faces[is_face], return_inverse=True)
    return Surface(vertices[used], faces.reshape(-1, 3))


def _find_seam_edges(surface: Surface, border: Border) -> Int[np.ndarray, "E 3"]:
    """Return the face, and the number of its edge's first corner, of edges on a border: (face, corner, next corner)."""
    on = np.abs(surface.vertices[:, border.axis] - border.value) <= _ON_BORDER
    faces = surface.faces
    rows = []
    for corner in range(3):
        following = (corner + 1) % 3
        is_edge = on[faces[:, corner]] & on[faces[:, following]]
        face = np.flatnonzero(is_edge)
        rows.append(np.stack([face, faces[face, corner], faces[face, following]], axis=1))
    return np.concatenate(rows)


def _find_opposite(
    points: Float[np.ndarray, "N 3"], curve: Surface, edges: Int[np.ndarray, "E 3"], axis: int
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return the place of a curve on a border that belongs to each point of another one, its distance, and the edge.

    It is the place straight above or below: then the curves' vertices alternate in one order, whichever side they are
    looked at from. Where the curve is so steep that the nearest place is much nearer, it is that one.
    """
    begin, end = curve.vertices[edges[:, 1]], curve.vertices[edges[:, 2]]
    along = end - begin
    squared = np.maximum((along**2).sum(axis=1), _LEAST_SQUARE)
    run = along[:, 1 - axis]
    is_level = np.abs(run) > _ON_BORDER
    places, distances = np.empty_like(points), np.empty(len(points))
    segments = np.empty(len(points), dtype=np.int64)
    for i, point in enumerate(points):
        share = np.clip(((point - begin) * along).sum(axis=1) / squared, 0.0, 1.0)
        gaps = np.linalg.norm(begin + share[:, None] * along - point, axis=1)
        segment = int(gaps.argmin())
        chosen = begin[segment] + share[segment] * along[segment]
        above = np.divide(
            point[1 - axis] - begin[:, 1 - axis], run, out=np.full(len(run), -1.0), where=is_level
        )
        spans = np.flatnonzero((above >= 0.0) & (above <= 1.0))
        heights = begin[spans, 2] + above[spans] * along[spans, 2]
        rises = np.abs(heights - point[2])
        if len(spans) and rises.min() <= _STEEP * gaps[segment] + _ON_BORDER:
            nearest = int(rises.argmin())
            segment = int(spans[nearest])
            chosen = np.array([point[0], point[1], heights[nearest]])
        places[i], segments[i] = chosen, segment
        distances[i] = float(np.linalg.norm(chosen - point))
    return places, distances, segments


def _insert_vertices(
    own: Surface,
    border: Border,
    other: Surface,
    max_gap: float,
    partners: dict[bytes, Float[np.ndarray, " 3"]],
) -> Surface:
    """Give the edges on a border the vertices that the other side has there, and note which vertex is whose."""
    edges, theirs = _find_seam_edges(own, border), _find_seam_edges(other, border)
    if not len(edges) or not len(theirs):
        return own
    visitors = other.vertices[np.unique(theirs[:, 1:])]
    vertices = own.vertices
    places, gaps, segments = _find_opposite(visitors, own, edges, border.axis)
    near = np.flatnonzero(gaps <= max_gap)
    added, new_faces = [], []
    split: dict[int, list[tuple[float, int]]] = {}
    for i in near:
        face, begin, end = edges[segments[i]]
        length = np.linalg.norm(vertices[end] - vertices[begin])
        along = float(np.linalg.norm(places[i] - vertices[begin]))
        if _ON_BORDER < along < length - _ON_BORDER:
            split.setdefault(int(segments[i]), []).append((along, len(vertices) + len(added)))
            added.append(places[i])
            partners[places[i].tobytes()] = visitors[i]
    is_kept = np.ones(len(own.faces), dtype=bool)
    for segment, stops in split.items():
        face, begin, end = (int(number) for number in edges[segment])
        if not is_kept[face]:
            continue
        is_kept[face] = False
        (apex,) = set(own.faces[face].tolist()) - {begin, end}
        chain = [begin, *(number for _, number in sorted(stops)), end]
        new_faces += [[chain[i], chain[i + 1], apex] for i in range(len(chain) - 1)]
    if not new_faces:
        return own
    faces = np.concatenate([own.faces[is_kept], np.array(new_faces, dtype=np.int64)])
    return _weld(Surface(np.concatenate([vertices, np.array(added)]), faces))


def _blend(
    vertices: Float[np.ndarray, "V 3"],
    neighbors: Mapping[tuple[int, int], Surface],
    place: tuple[int, int],
    config: TilesConfig,
    max_gap: float,
) -> Float[np.ndarray, "V 3"]:
    """Move vertices in the halo towards the mean of all surfaces there; weights fall from 1 at a border to 0."""
    total, weights = vertices.copy(), np.ones(len(vertices))
    for shift, neighbor in sorted(neighbors.items()):
        weight = np.ones(len(vertices))
        for axis, step in enumerate(shift):
            if step:
                depth = np.abs(vertices[:, axis] - (place[axis] + (step > 0)) * config.tile)
                weight *= np.clip(1.0 - depth / config.width, 0.0, 1.0)
        near = np.flatnonzero(weight > 0)
        if not len(near) or not len(neighbor.faces):
            continue
        places, gaps = _project(vertices[near], neighbor)
        # Fades out towards the gap at which surfaces are no longer the same one: nothing jumps there.
        share = weight[near] * np.clip(2.0 - 2.0 * gaps / max_gap, 0.0, 1.0)
        total[near] += share[:, None] * places
        weights[near] += share
    return total / weights[:, None]


def _project(
    points: Float[np.ndarray, "N 3"], surface: Surface
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, " N"]]:
    """Return the nearest places on a surface and their distances."""
    import igl

    squared, _, places = igl.point_mesh_squared_distance(
        points, surface.vertices, np.ascontiguousarray(surface.faces, dtype=np.int64)
    )
    return np.asarray(places).reshape(-1, 3), np.sqrt(np.asarray(squared).reshape(-1))


def _meet(
    cut: Surface,
    moved: Float[np.ndarray, "V 3"],
    border: Border,
    other: Surface,
    max_gap: float,
    partners: Mapping[bytes, Float[np.ndarray, " 3"]],
) -> Float[np.ndarray, "V 3"]:
    """Put the vertices on a border in the middle between both cuts: from both sides, that is the same place."""
    edges, theirs = _find_seam_edges(cut, border), _find_seam_edges(other, border)
    if not len(edges) or not len(theirs):
        return moved
    numbers = np.unique(edges[:, 1:])
    points = cut.vertices[numbers]
    places, gaps, _ = _find_opposite(points, other, theirs, border.axis)
    result = moved.copy()
    for number, point, place, gap in zip(numbers, points, places, gaps, strict=True):
        partner = partners.get(point.tobytes())
        if partner is not None or gap <= max_gap:
            result[number] = (point + (place if partner is None else partner)) / 2
    return result


def _meet_corners(
    vertices: Float[np.ndarray, "V 3"],
    moved: Float[np.ndarray, "V 3"],
    surfaces: Mapping[tuple[int, int], Surface],
    place: tuple[int, int],
    tile: float,
    max_gap: float,
) -> Float[np.ndarray, "V 3"]:
    """Put vertices on a corner of the tile at the mean height of all tiles that meet there."""
    result = moved.copy()
    for x in (-1, 1):
        for y in (-1, 1):
            corner = np.array([(place[0] + (x > 0)) * tile, (place[1] + (y > 0)) * tile])
            meeting = [surfaces[shift] for shift in ((0, 0), (x, 0), (0, y), (x, y)) if shift in surfaces]
            for number in np.flatnonzero((np.abs(vertices[:, :2] - corner) <= _ON_BORDER).all(axis=1)):
                heights = []
                for surface in meeting:  # the tile's own, too: all four compute bit-identical values
                    found = _compute_heights(surface, corner)
                    gaps = np.abs(found - vertices[number, 2])
                    heights += [float(found[gaps.argmin()])] if len(found) and gaps.min() <= max_gap else []
                if heights:
                    result[number] = [*corner, float(np.mean(sorted(heights)))]
    return result


def _compute_heights(surface: Surface, place: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " N"]:
    """Return the heights of a surface above a place in plan."""
    corners = surface.vertices[surface.faces]
    near: Bool[np.ndarray, " F"] = (
        (corners[:, :, :2].min(axis=1) <= place) & (corners[:, :, :2].max(axis=1) >= place)
    ).all(axis=1)
    first, second, third = (corners[near, i] for i in range(3))
    area = _cross_plan(second - first, third - first)
    is_seen = np.abs(area) > 1e-12
    first, second, third, area = first[is_seen], second[is_seen], third[is_seen], area[is_seen]
    to_place = place - first[:, :2]
    u, v = _cross_plan(to_place, third - first) / area, _cross_plan(second - first, to_place) / area
    inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    return (first[:, 2] + u * (second[:, 2] - first[:, 2]) + v * (third[:, 2] - first[:, 2]))[inside]


def _cross_plan(a: Float[np.ndarray, "N K"], b: Float[np.ndarray, "N L"]) -> Float[np.ndarray, " N"]:
    """Return the z component of cross products in plan."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
