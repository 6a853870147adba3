"""Convex pieces of a terrain cut at their creases and, where that moves no ground, turned into boxes.

A simulator first compares the boxes around geoms, then the geoms. A piece bent at a crease lies loosely in its box,
so robots next to it are compared with it for nothing; parts under one plane each lie tightly. Contacts of a part that
is a box are found several times faster than those of a hull.
"""

from itertools import product

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import (
    STEEP,
    Rectangle,
    compute_halfspaces,
    compute_tops,
    find_inner_point,
    find_tight_rectangles,
    make_solid,
)
from reconstruction._src.geometry.outlines import compute_hull_outline
from reconstruction._src.geometry.rows import make_hull
from reconstruction._src.geometry.sampling import sample_grid

Halfspaces = Float[np.ndarray, "H 4"]  # Inside is a x + b y + c z + d <= 0

_NOTHING = -1e6  # Height of what is not there [m]
_MIN_VOLUME = 1e-6  # Smaller parts are none [m³]
_BEND_DEG = 5.0  # Planes on top of a piece that differ by less make no crease
_MIN_SHARE = 0.04  # A plane with less of a piece's top gets no part of its own
_OVERLAP = 0.02  # Parts overlap by this at a crease [m]
_DEPTHS = (1.0, 0.2, 0.1, 0.05)
"""Boxes tried are this deep [m], but no deeper than the piece: shallow ones fit where deep ones stick out."""
_TOLERANCE = 1e-3
"""A box may lift or lower the ground by this, in a few places and at walls by twice as much [m]."""
_BOX_FEW = 5e-3  # Share of the points that are a few places
_BOX_AIR = 0.05  # A box may reach beyond the rim of the terrain by this [m]
_ON_TOP = 2e-3  # Corners this close to the main plane of a piece bound its outline [m]
_TOP_POINTS = 120  # Points a side of the grid on which the top of a piece is looked at
_CHECK_POINTS = 140  # Points a side of the grid on which a box is compared with the piece
_PIECE_POINTS = 160  # Points a side of the grid on which a piece is compared with those above it
_LIFT = 2e-4  # Ground lifted by less is not [m]
_WALL_AREA = 1e-4  # One point on a wall for this much of a piece's area [m²], within `wall_points`
_WALL_POINTS = (500, 6000)  # Fewest and most points on the walls of a piece
_WALL_GAP = 5e-3  # What rises less above the ground in front of it is no wall [m]; also how far in front [m]


def split_at_creases(pieces: list[trimesh.Trimesh], max_pieces: int) -> list[trimesh.Trimesh]:
    """Return pieces cut along the creases on their tops, the largest first, while they are few enough."""
    largest_first = sorted(range(len(pieces)), key=lambda i: -pieces[i].volume)
    parts = {i: [piece] for i, piece in enumerate(pieces)}
    room = max_pieces - len(pieces)
    for i in largest_first:
        cut = _split(pieces[i])
        if len(cut) - 1 <= room:
            parts[i], room = cut, room - len(cut) + 1
    return [part for i in range(len(pieces)) for part in parts[i]]


class _Top:
    """The planes on top of a piece, and the share of its top that is under each."""

    def __init__(self, piece: trimesh.Trimesh) -> None:
        self.halfspaces = compute_halfspaces(piece)
        self.planes = self.halfspaces[self.halfspaces[:, 2] > STEEP]
        points = sample_grid(np.asarray(piece.vertices), _TOP_POINTS)
        points = points[np.isfinite(compute_tops(self.halfspaces, points))]
        self.slopes = -self.planes[:, [0, 1, 3]] / self.planes[:, 2:3]
        self.counts, self.num_points = np.zeros(len(self.planes), dtype=np.int64), len(points)
        if len(self.planes):
            owner = np.argmin(points @ self.slopes[:, :2].T + self.slopes[:, 2], axis=1)
            self.counts = np.bincount(owner, minlength=len(self.planes))


def _split(piece: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Return the parts of a piece under each of its planes; the piece itself where it is under one."""
    top = _Top(piece)
    if len(top.planes) < 2 or not top.num_points:
        return [piece]
    planes = _find_bent(top)
    parts = []
    for k in planes if len(planes) > 1 else []:
        step = top.slopes[k] - top.slopes[[j for j in planes if j != k]]
        size = np.linalg.norm(step[:, :2], axis=1, keepdims=True)
        step /= size
        sides = np.column_stack([step[:, :2], np.zeros(len(step)), step[:, 2] - _OVERLAP])
        bounds = np.concatenate([top.halfspaces, sides])
        part = make_solid(bounds, find_inner_point(bounds))
        if part is None or part.volume < _MIN_VOLUME:
            return [piece]
        parts.append(part)
    return parts or [piece]


def _find_bent(top: _Top) -> list[int]:
    """Return the planes with much of a top that are bent against each other, the largest first."""
    share = top.counts / top.num_points
    min_cosine = np.cos(np.radians(_BEND_DEG))
    planes: list[int] = []
    for k in np.argsort(-share, kind="stable"):
        is_bent = all(top.planes[k, :3] @ top.planes[j, :3] < min_cosine for j in planes)
        if share[k] > _MIN_SHARE and is_bent:
            planes.append(int(k))
    return planes


def turn_into_boxes(pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    """Return pieces with a box in place of each that can be one."""
    boxed = list(pieces)
    for i in range(len(boxed)):
        others = [compute_halfspaces(piece) for k, piece in enumerate(boxed) if k != i]
        boxed[i] = _find_box(boxed[i], others, ground)
    return boxed


def _find_box(piece: trimesh.Trimesh, others: list[Halfspaces], ground: Elevation) -> trimesh.Trimesh:
    """Return a box under the piece's main plane that changes no contact; else the piece."""
    top = _Top(piece)
    if not len(top.planes):
        return piece
    plane = top.planes[int(np.argmax(top.counts))]
    first = np.cross([0.0, 1.0, 0.0], plane[:3])
    first /= np.linalg.norm(first)
    frame = np.column_stack([first, np.cross(plane[:3], first), plane[:3]])  # the third axis is the normal
    corners = np.asarray(piece.vertices)
    is_on_top = np.abs(corners @ plane[:3] + plane[3]) < _ON_TOP
    outline = compute_hull_outline(corners[is_on_top] @ frame[:, :2]) if is_on_top.sum() >= 3 else None
    if outline is None:
        return piece
    check = _ContactCheck(piece, top.halfspaces, others, ground)
    height = -plane[3]
    reach = float(height - (corners @ plane[:3]).min())
    rectangles = find_tight_rectangles(outline)
    for depth in _DEPTHS:
        boxes = [_make_box(frame, each, height - min(depth, reach), height) for each in rectangles]
        moves = [np.inf if box is None else check.measure(box) for box in boxes]
        best = boxes[int(np.argmin(moves))]
        if best is not None and min(moves) < np.inf:
            return best
    return piece


def _make_box(
    frame: Float[np.ndarray, "3 3"], rectangle: Rectangle, bottom: float, height: float
) -> trimesh.Trimesh | None:
    """Return the box over a rectangle in the first two axes of a frame, between two levels of the third."""
    axes = np.column_stack([frame[:, :2] @ rectangle.axes, frame[:, 2]])
    spans = zip([*rectangle.low, bottom], [*rectangle.high, height], strict=True)
    return make_hull(np.array(list(product(*spans))) @ axes.T)


class _ContactCheck:
    """Whether contact stays where it is when one piece is replaced."""

    def __init__(
        self,
        piece: trimesh.Trimesh,
        halfspaces: Float[np.ndarray, "G 4"],
        others: list[Halfspaces],
        ground: Elevation,
    ) -> None:
        self._ground, self._others = ground, others
        low, high = piece.bounds
        margin = np.array([_BOX_AIR, _BOX_AIR, 0.0])
        self._points = sample_grid(np.array([low - 2 * margin, high + 2 * margin]), _CHECK_POINTS)
        neighbors = np.stack(
            [compute_tops(other, self._points) for other in others] or [np.full(len(self._points), -np.inf)]
        )
        self._neighbors = neighbors.max(axis=0)
        own = compute_tops(halfspaces, self._points)
        before, height = np.maximum(self._neighbors, own), ground.height(*self._points.T)
        is_ground = np.isfinite(height)
        self._highest = np.where(is_ground, np.fmax(before, height), np.inf)
        self._lowest = np.where(is_ground & np.isfinite(before), np.fmin(before, height), _NOTHING)
        self._before, self._is_ground = before, is_ground & np.isfinite(before)
        self._walls = self._find_walls(piece)

    def _find_walls(self, piece: trimesh.Trimesh) -> Float[np.ndarray, "N 3"]:
        """Return points on the sides of the piece that stand free above ground."""
        fewest, most = _WALL_POINTS
        count = int(min(max(float(piece.area) / _WALL_AREA, fewest), most))
        found = trimesh.sample.sample_surface(piece, count, seed=0)
        places, normals = np.asarray(found[0]), np.asarray(piece.face_normals)[np.asarray(found[1])]
        is_side = np.abs(normals[:, 2]) < STEEP
        places, normals = places[is_side], normals[is_side]
        front = self._ground.height(*(places + _WALL_GAP * normals)[:, :2].T)
        return places[front < places[:, 2] - _WALL_GAP]

    def measure(self, box: trimesh.Trimesh) -> float:
        """Return how far a box moves the ground at most [m]; inf where that, or what it does to walls, is too much.

        Beyond the rim of the terrain nothing counts.
        """
        halfspaces = compute_halfspaces(box)
        own = compute_tops(halfspaces, self._points)
        after = np.maximum(np.maximum(self._neighbors, own), _NOTHING)
        off = np.maximum(after - self._highest, self._lowest - after)
        if off.max() > 2 * _TOLERANCE or (off > _TOLERANCE).sum() > _BOX_FEW * len(off):
            return np.inf
        if len(self._walls):
            depth = _measure_depth(self._walls, halfspaces)
            for other in self._others:
                depth = np.minimum(depth, _measure_depth(self._walls, other))
            if (depth > 2 * _TOLERANCE).any():
                return np.inf
        return float(np.abs(after - self._before)[self._is_ground].max(initial=0.0))


def _measure_depth(points: Float[np.ndarray, "N 3"], halfspaces: Halfspaces) -> Float[np.ndarray, " N"]:
    """Return how far points lie outside of a convex solid, below 0 inside [m]."""
    return (points @ halfspaces[:, :3].T + halfspaces[:, 3]).max(axis=1)


def drop_hidden(pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
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
