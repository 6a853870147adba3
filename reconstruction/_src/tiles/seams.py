"""Where tiles meet: surfaces are cut at the border, moved onto the mean of the neighbors, and get the same vertices."""

import itertools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.geometry.rows import Vertices, drop_unused
from reconstruction._src.tiles.point_stream import Place, TilesConfig

_ON_BORDER = 1e-9  # A vertex this near to a border lies on it [m]
_LEAST_SQUARE = 1e-30  # Squared length of an edge without length [m²]
_STEEP = 4.0  # Beyond 76 degrees, curves that are a little apart in plan are far apart in height
_MAX_GAP = 0.5
"""Surfaces of two tiles farther apart than this share of the halo are roof and ground, not joined."""


class Surface(NamedTuple):
    """Vertices [m] and faces of a surface."""

    vertices: Vertices
    faces: Int[np.ndarray, "F 3"]


class _Border(NamedTuple):
    """One side of a tile."""

    axis: int  # 0 for a border of constant x, 1 for one of constant y
    value: float  # that coordinate [m]


_Partners = dict[bytes, np.ndarray]  # Place of a vertex added on a border -> the other side's vertex there


def join_tile(own: Surface, neighbors: Mapping[Place, Surface], place: Place, config: TilesConfig) -> Surface:
    """Return the surface of a tile, cut at its borders, without a step to its neighbors (by their shift in tiles).

    In the halo, a vertex moves towards the mean of its tile's surface and those of the neighbors; at the border it lies
    on that mean. Both sides of a border get the vertices of both, at the same places.
    """
    max_gap = _MAX_GAP * config.width
    cuts = {
        (x, y): clip(surface, (place[0] + x, place[1] + y), config.tile)
        for (x, y), surface in sorted({**neighbors, (0, 0): own}.items())
    }
    cut = cuts[0, 0]
    if not len(cut.faces):
        return cut
    curves: dict[_Border, Surface] = {}
    for shift, curve in cuts.items():
        if shift != (0, 0) and 0 in shift:
            axis, step = (0, shift[0]) if shift[0] else (1, shift[1])
            curves[_Border(axis, (place[axis] + (step > 0)) * config.tile)] = curve
    partners: _Partners = {}
    for border, curve in curves.items():
        cut = _insert_vertices(cut, border, curve, max_gap, partners)
    moved = _blend(cut.vertices, neighbors, place, config, max_gap)
    for border, curve in curves.items():
        _meet(cut, moved, border, curve, max_gap, partners)
    for x, y in itertools.product((-1, 1), repeat=2):
        meeting = [cuts[shift].vertices for shift in ((0, 0), (x, 0), (0, y), (x, y)) if shift in cuts]
        corner = np.array([(place[0] + (x > 0)) * config.tile, (place[1] + (y > 0)) * config.tile])
        _meet_at_corner(cut.vertices, moved, corner, meeting, max_gap)
    return Surface(moved, cut.faces)


def clip(surface: Surface, place: Place, tile: float) -> Surface:
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
    is_inside = beyond >= 0
    inside = is_inside[faces].sum(axis=1)
    kept = faces[(inside == 3) & (beyond[faces] > 0).any(axis=1)]
    mixed = faces[(inside == 1) | (inside == 2)]
    # Rolled so that the odd corner is first: the one inside, or the one outside.
    is_single = is_inside[mixed].sum(axis=1) == 1
    odd = (is_inside[mixed] == is_single[:, None]).argmax(axis=1)
    a, b, c = mixed[np.arange(len(mixed))[:, None], (odd[:, None] + np.arange(3)) % 3].T
    edges = np.sort(np.concatenate([np.stack([a, b], axis=1), np.stack([a, c], axis=1)]), axis=1)
    ends, numbers = np.unique(edges, axis=0, return_inverse=True)  # once an edge: its faces share the vertex
    begin, end = ends.T
    share = beyond[begin] / (beyond[begin] - beyond[end])
    new = vertices[begin] + share[:, None] * (vertices[end] - vertices[begin])
    new[:, axis] = value
    first, second = (len(vertices) + numbers).reshape(2, -1)
    parts = [
        kept,
        np.stack([a, first, second], axis=1)[is_single],
        np.stack([first, b, c], axis=1)[~is_single],
        np.stack([first, c, second], axis=1)[~is_single],
    ]
    return _weld(Surface(np.concatenate([vertices, new]), np.concatenate(parts)))


def _weld(surface: Surface) -> Surface:
    """Join vertices at one place, and drop faces without area and vertices without face."""
    vertices, numbers = np.unique(surface.vertices, axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[surface.faces]
    is_face = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Surface(*drop_unused(vertices, faces[is_face]))


def _find_seam_edges(surface: Surface, border: _Border) -> Int[np.ndarray, "E 3"]:
    """Return the edges on a border: (face, corner, next corner)."""
    on = np.abs(surface.vertices[:, border.axis] - border.value) <= _ON_BORDER
    corners, following = surface.faces.T, np.roll(surface.faces, -1, axis=1).T
    _, face = is_edge = np.nonzero(on[corners] & on[following])
    return np.stack([face, corners[is_edge], following[is_edge]], axis=1)


def _find_opposite(
    points: Float[np.ndarray, "N 3"], curve: Surface, edges: Int[np.ndarray, "E 3"], axis: int
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return the place of a curve on a border that belongs to each point of another one, its distance, and the edge.

    It is the place straight above or below: then the curves' vertices alternate in one order, whichever side they are
    looked at from. Where the curve is so steep that the nearest place is much nearer, it is that one.
    """
    rows = np.arange(len(points))
    begin = curve.vertices[edges[:, 1]]
    along = curve.vertices[edges[:, 2]] - begin
    offset = points[:, None] - begin
    squared = np.maximum((along**2).sum(axis=1), _LEAST_SQUARE)
    share = np.clip((offset * along).sum(axis=2) / squared, 0.0, 1.0)
    nearest = begin + share[:, :, None] * along
    gaps = np.linalg.norm(nearest - points[:, None], axis=2)
    segment = gaps.argmin(axis=1)
    places = nearest[rows, segment]

    run = np.where(np.abs(along[:, 1 - axis]) > _ON_BORDER, along[:, 1 - axis], np.nan)
    above = offset[:, :, 1 - axis] / run
    heights = begin[:, 2] + above * along[:, 2]
    rises = np.where((above >= 0.0) & (above <= 1.0), np.abs(heights - points[:, 2:]), np.inf)
    over = rises.argmin(axis=1)
    is_over = rises[rows, over] <= _STEEP * gaps[rows, segment] + _ON_BORDER
    straight = np.c_[points[:, :2], heights[rows, over]]
    places = np.where(is_over[:, None], straight, places)
    return places, np.linalg.norm(places - points, axis=1), np.where(is_over, over, segment)


def _insert_vertices(
    own: Surface, border: _Border, other: Surface, max_gap: float, partners: _Partners
) -> Surface:
    """Give the edges on a border the vertices that the other side has there, and note which vertex is whose."""
    edges, theirs = _find_seam_edges(own, border), _find_seam_edges(other, border)
    if not len(edges) or not len(theirs):
        return own
    visitors = other.vertices[np.unique(theirs[:, 1:])]
    vertices = own.vertices
    places, gaps, segments = _find_opposite(visitors, own, edges, border.axis)
    added = []
    split: dict[int, list[tuple[float, int]]] = {}
    for i in np.flatnonzero(gaps <= max_gap):
        _, begin, end = edges[segments[i]]
        length = np.linalg.norm(vertices[end] - vertices[begin])
        along = float(np.linalg.norm(places[i] - vertices[begin]))
        if _ON_BORDER < along < length - _ON_BORDER:
            split.setdefault(int(segments[i]), []).append((along, len(vertices) + len(added)))
            added.append(places[i])
            partners[places[i].tobytes()] = visitors[i]
    is_kept, new_faces = np.ones(len(own.faces), dtype=bool), []
    for segment, stops in split.items():
        face, begin, end = (int(number) for number in edges[segment])
        if is_kept[face]:
            is_kept[face] = False
            (apex,) = set(own.faces[face].tolist()) - {begin, end}
            chain = [begin, *(number for _, number in sorted(stops)), end]
            new_faces += [[*pair, apex] for pair in itertools.pairwise(chain)]
    if not new_faces:
        return own
    faces = np.concatenate([own.faces[is_kept], np.array(new_faces, dtype=np.int64)])
    return _weld(Surface(np.concatenate([vertices, np.array(added)]), faces))


def _blend(
    vertices: Vertices, neighbors: Mapping[Place, Surface], place: Place, config: TilesConfig, max_gap: float
) -> Vertices:
    """Move vertices in the halo towards the mean of all surfaces there; weights fall from 1 at a border to 0."""
    import igl

    total, weights = vertices.copy(), np.ones(len(vertices))
    for shift, (corners, faces) in sorted(neighbors.items()):
        weight = np.ones(len(vertices))
        for axis, step in enumerate(shift):
            if step:
                depth = np.abs(vertices[:, axis] - (place[axis] + (step > 0)) * config.tile)
                weight *= np.clip(1.0 - depth / config.width, 0.0, 1.0)
        near = np.flatnonzero(weight > 0)
        if not len(near) or not len(faces):
            continue
        squared, _, places = igl.point_mesh_squared_distance(
            vertices[near], corners, np.ascontiguousarray(faces, dtype=np.int64)
        )
        # Fades out towards the gap at which surfaces are no longer the same one: nothing jumps there.
        share = weight[near] * np.clip(2.0 - 2.0 * np.sqrt(np.reshape(squared, -1)) / max_gap, 0.0, 1.0)
        total[near] += share[:, None] * np.reshape(places, (-1, 3))
        weights[near] += share
    return total / weights[:, None]


def _meet(
    cut: Surface, moved: Vertices, border: _Border, other: Surface, max_gap: float, partners: _Partners
) -> None:
    """Put the vertices on a border in the middle between both cuts: from both sides, that is the same place."""
    edges, theirs = _find_seam_edges(cut, border), _find_seam_edges(other, border)
    if not len(edges) or not len(theirs):
        return
    numbers = np.unique(edges[:, 1:])
    points = cut.vertices[numbers]
    places, gaps, _ = _find_opposite(points, other, theirs, border.axis)
    for number, point, place, gap in zip(numbers, points, places, gaps, strict=True):
        partner = partners.get(point.tobytes())
        if partner is not None or gap <= max_gap:
            moved[number] = (point + (place if partner is None else partner)) / 2


def _meet_at_corner(
    vertices: Vertices,
    moved: Vertices,
    corner: Float[np.ndarray, " 2"],
    meeting: list[np.ndarray],
    max_gap: float,
) -> None:
    """Put vertices on a corner of the tile at the mean height of all tiles that meet there: cut, they have it too."""
    heights = [cut[(np.abs(cut[:, :2] - corner) <= _ON_BORDER).all(axis=1), 2] for cut in meeting]
    for number in np.flatnonzero((np.abs(vertices[:, :2] - corner) <= _ON_BORDER).all(axis=1)):
        nearest = [each[np.abs(each - vertices[number, 2]).argmin()] for each in heights if len(each)]
        near = [height for height in nearest if abs(height - vertices[number, 2]) <= max_gap]
        if near:
            moved[number] = [*corner, float(np.mean(sorted(near)))]
