"""Convex pieces of a terrain cut at their creases and, where that moves no ground, turned into boxes.

A simulator first compares boxes around things, then the things. A piece bent at a crease lies loosely in its
box, so robots beside it are looked at in vain; parts under one plane each lie tightly. A part that is a box
touches several times faster than a hull.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.halfspaces import (
    STEEP,
    find_halfspaces,
    find_inner_point,
    find_tops,
    make_solid,
)
from reconstruction.geometry.hulls import make_hull
from reconstruction.geometry.outlines import hull_2d
from reconstruction.geometry.sampling import sample_grid

_BEND_DEG = 5.0
"""Planes on top of a piece that differ by less make no crease."""
_SHARE = 0.04
"""A plane with less of a piece's top is no part of its own."""
_OVERLAP = 0.02
"""Parts overlap by so much at a crease [m]."""
_DEPTHS = (1.0, 0.2, 0.1, 0.05)
"""Boxes tried are so deep [m], but no deeper than the piece."""
_TOLERANCE = 1e-3
"""A box may lift or lower the ground by so much, in a few places and at walls by twice as much [m]."""
_FEW = 5e-3
"""Share of the points that are a few places."""
_NOTHING = -1e6
"""Height of what is not there [m]."""
_AIR = 0.05
"""How far a box may reach beyond the rim of the terrain [m]."""


def split_at_creases(pieces: list[trimesh.Trimesh], max_pieces: int) -> list[trimesh.Trimesh]:
    """Return pieces cut along the creases on their tops, the largest first, while they are few enough."""
    largest_first = sorted(range(len(pieces)), key=lambda i: -pieces[i].volume)
    parts = {i: [piece] for i, piece in enumerate(pieces)}
    count = len(pieces)
    for i in largest_first:
        cut = _split(pieces[i])
        if count + len(cut) - 1 <= max_pieces:
            parts[i] = cut
            count += len(cut) - 1
    return [part for i in range(len(pieces)) for part in parts[i]]


def _split(piece: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """The part of a piece under each of its planes; the piece itself where it is under one."""
    halfspaces = find_halfspaces(piece)
    tops = halfspaces[halfspaces[:, 2] > STEEP]
    points = sample_grid(np.asarray(piece.vertices), 120)
    points = points[np.isfinite(find_tops(halfspaces, points))]
    if len(tops) < 2 or not len(points):
        return [piece]
    slopes = -tops[:, [0, 1, 3]] / tops[:, 2:3]
    owner = np.argmin(points @ slopes[:, :2].T + slopes[:, 2], axis=1)
    share = np.bincount(owner, minlength=len(tops)) / len(points)
    planes: list[int] = []
    for k in np.argsort(-share, kind="stable"):
        is_bent = all(tops[k, :3] @ tops[j, :3] < np.cos(np.radians(_BEND_DEG)) for j in planes)
        if share[k] > _SHARE and is_bent:
            planes.append(int(k))
    parts = []
    for k in planes if len(planes) > 1 else []:
        step = slopes[k] - slopes[[j for j in planes if j != k]]
        size = np.linalg.norm(step[:, :2], axis=1, keepdims=True)
        step /= size
        sides = np.column_stack([step[:, :2], np.zeros(len(step)), step[:, 2] - _OVERLAP])
        bounds = np.concatenate([halfspaces, sides])
        inner = find_inner_point(bounds)
        part = make_solid(bounds, inner) if inner is not None else None
        if part is None or part.volume < 1e-6:
            return [piece]
        parts.append(part)
    return parts or [piece]


def turn_into_boxes(
    pieces: list[trimesh.Trimesh], surface: trimesh.Trimesh, is_late: Callable[[], bool] = lambda: False
) -> list[trimesh.Trimesh]:
    """Return pieces with a box in place of each that can be one.

    Args:
        pieces: convex solids that follow a terrain from below.
        surface: the terrain.
        is_late: asked now and then; once true, the other pieces stay as they are.
    """
    ground, boxed = Elevation(surface), list(pieces)
    for i in range(len(boxed)):
        if is_late():
            break
        others = [find_halfspaces(piece) for k, piece in enumerate(boxed) if k != i]
        boxed[i] = _find_box(boxed[i], others, ground)
    return boxed


def _find_box(piece: trimesh.Trimesh, others: list[np.ndarray], ground: Elevation) -> trimesh.Trimesh:
    """A box under the piece's main plane that changes nothing to be touched; else the piece."""
    halfspaces = find_halfspaces(piece)
    tops = halfspaces[halfspaces[:, 2] > STEEP]
    if not len(tops):
        return piece
    corners = np.asarray(piece.vertices)
    points = sample_grid(corners, 120)
    before = find_tops(halfspaces, points)
    slopes = -tops[:, [0, 1, 3]] / tops[:, 2:3]
    points, before = points[np.isfinite(before)], before[np.isfinite(before)]
    share = np.bincount(np.argmin(points @ slopes[:, :2].T + slopes[:, 2], axis=1), minlength=len(tops))
    plane = tops[int(np.argmax(share))]
    frame = _make_frame(plane[:3])
    is_on_top = np.abs(corners @ plane[:3] + plane[3]) < 2e-3
    outline = hull_2d(corners[is_on_top] @ frame[:, :2]) if is_on_top.sum() >= 3 else None
    if outline is None:
        return piece
    check = _Check(piece, halfspaces, others, ground)
    height = -plane[3]
    reach = float(height - (corners @ plane[:3]).min())
    rectangles = _find_rectangles(outline)
    for depth in _DEPTHS:
        bottom = height - min(depth, reach)
        best, least = None, np.inf
        for low, high, turn in rectangles:
            axes = np.column_stack([frame[:, :2] @ turn, plane[:3]])
            spans = zip([*low, bottom], [*high, height], strict=True)
            box = make_hull(np.array(list(product(*spans))) @ axes.T)
            off = check.measure(box) if box is not None else np.inf
            if off < least:
                best, least = box, off
        if best is not None:
            return best
    return piece


def _make_frame(normal: np.ndarray) -> np.ndarray:
    """Axes in columns, the third along the normal."""
    first = np.cross([0.0, 1.0, 0.0], normal)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(normal, first), normal])


def _find_rectangles(outline: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Rectangles much like a convex outline: lower and upper corner in axes (columns).

    Each side lies at the outermost corner, or half way to the far end of the edge that is there.
    """
    found = []
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(edges, axis=1)
    for edge in edges[lengths > 0.25 * lengths.max()]:
        along = edge / np.linalg.norm(edge)
        turn = np.column_stack([along, [-along[1], along[0]]])
        places = outline @ turn
        following = np.roll(places, -1, axis=0)
        choices = []
        for axis, sign in product(range(2), (-1.0, 1.0)):
            level, after = sign * places[:, axis], sign * following[:, axis]
            run = np.abs(places[:, 1 - axis] - following[:, 1 - axis])
            middle = (level + after) / 2
            side = int(np.argmax(np.where(run > 0.3 * np.ptp(places[:, 1 - axis]), middle, -np.inf)))
            choices.append(
                sorted({sign * float(level.max()), sign * float(middle[side])}, key=lambda v: -sign * v)
            )
        for x0, x1, y0, y1 in product(*choices):
            found.append((np.array([x0, y0]), np.array([x1, y1]), turn))
    return found


class _Check:
    """Whether what can be touched stays where it is when one piece is replaced."""

    def __init__(
        self, piece: trimesh.Trimesh, halfspaces: np.ndarray, others: list[np.ndarray], ground: Elevation
    ) -> None:
        self._ground, self._others = ground, others
        low, high = piece.bounds
        margin = np.array([_AIR, _AIR, 0.0])
        self._points = sample_grid(np.array([low - 2 * margin, high + 2 * margin]), 140)
        beside = np.stack(
            [find_tops(other, self._points) for other in others] or [np.full(len(self._points), -np.inf)]
        )
        self._beside = beside.max(axis=0)
        own = find_tops(halfspaces, self._points)
        before, height = np.maximum(self._beside, own), ground.height(*self._points.T)
        is_ground = np.isfinite(height)
        self._highest = np.where(is_ground, np.fmax(before, height), np.inf)
        self._lowest = np.where(is_ground & np.isfinite(before), np.fmin(before, height), _NOTHING)
        self._before, self._is_ground = before, is_ground & np.isfinite(before)
        self._walls = self._find_walls(piece)

    def _find_walls(self, piece: trimesh.Trimesh) -> np.ndarray:
        """Points on the sides of the piece that stand free above ground, `[N, 3]`."""
        area = float(piece.area)
        found: Any = trimesh.sample.sample_surface(piece, int(min(max(area / 1e-4, 500), 6000)), seed=0)
        places, normals = np.asarray(found[0]), np.asarray(piece.face_normals)[found[1]]
        is_side = np.abs(normals[:, 2]) < STEEP
        places, normals = places[is_side], normals[is_side]
        front = self._ground.height(*(places + 5e-3 * normals)[:, :2].T)
        return places[front < places[:, 2] - 5e-3]

    def measure(self, box: trimesh.Trimesh) -> float:
        """Return how far a box moves the ground at most [m]; inf where that, or what it does to walls, is too much.

        Beyond the rim of the terrain nothing counts.
        """
        halfspaces = find_halfspaces(box)
        own = find_tops(halfspaces, self._points)
        after = np.maximum(np.maximum(self._beside, own), _NOTHING)
        off = np.maximum(after - self._highest, self._lowest - after)
        if off.max() > 2 * _TOLERANCE or (off > _TOLERANCE).sum() > _FEW * len(off):
            return np.inf
        if len(self._walls):
            depth = (self._walls @ halfspaces[:, :3].T + halfspaces[:, 3]).max(axis=1)
            for other in self._others:
                depth = np.minimum(depth, (self._walls @ other[:, :3].T + other[:, 3]).max(axis=1))
            if (depth > 2 * _TOLERANCE).any():
                return np.inf
        return float(np.abs(after - self._before)[self._is_ground].max(initial=0.0))
