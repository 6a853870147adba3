"""Rectangles and boxes around points: the smallest one, tight ones, and the one that a solid already is."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.outlines import find_hull_outline

_RIGHT_ANGLE = 1e-5
"""Cosine between edges that still counts as a right angle: pieces are saved to 1 µm."""
_CORNER_TOLERANCE = 5e-6
"""How far a corner may lie from that of the box [m]: a few times the 1 µm to which pieces are saved."""
_LONG_EDGE = 0.25
"""Edges of an outline shorter than this share of the longest give a rectangle no direction."""
_LONG_SIDE = 0.3
"""An edge that runs along less than this share of a side is a bevelled corner, not the side."""


class Rectangle(NamedTuple):
    """A rectangle in a plane.

    Attributes:
        low: `[2]` lower corner, along the axes.
        high: `[2]` upper corner.
        axes: `[2, 2]` unit vectors in columns.
    """

    low: Float[np.ndarray, " 2"]
    high: Float[np.ndarray, " 2"]
    axes: Float[np.ndarray, "2 2"]


class Box(NamedTuple):
    """A box in space.

    Attributes:
        center: `[3]` [m].
        half_sizes: `[3]` [m].
        axes: `[3, 3]` unit vectors in columns, right-handed.
    """

    center: Float[np.ndarray, " 3"]
    half_sizes: Float[np.ndarray, " 3"]
    axes: Float[np.ndarray, "3 3"]


def find_box(piece: trimesh.Trimesh) -> Box | None:
    """Return the box that a convex piece is; None where it is something else."""
    corners = np.asarray(piece.vertices, dtype=np.float64)
    if len(corners) != 8:
        return None
    center = corners.mean(axis=0)
    edges = corners[1:] - corners[0]
    edges = edges[np.argsort(np.linalg.norm(edges, axis=1))]
    axes = [edges[0]]
    for edge in edges[1:]:
        if len(axes) < 3 and all(abs(edge @ axis) <= _RIGHT_ANGLE * np.linalg.norm(edge) for axis in axes):
            axes.append(edge)
    if len(axes) < 3:
        return None
    sizes = np.linalg.norm(axes, axis=1)
    frame = (np.array(axes) / sizes[:, None]).T
    if np.linalg.det(frame) < 0:
        frame[:, 2] *= -1.0
    if not np.allclose(np.abs((corners - center) @ frame), sizes / 2, atol=_CORNER_TOLERANCE):
        return None
    return Box(center, sizes / 2, frame)


def find_smallest_rectangle(points: Float[np.ndarray, "N 2"], trimmed: float) -> Rectangle | None:
    """Return the smallest rectangle around points along an edge of their hull; None where they lie on a line."""
    outline = find_hull_outline(points)
    if outline is None:
        return None
    best, least = None, np.inf
    for edge in np.roll(outline, -1, axis=0) - outline:
        axes = _align(edge)
        low, high = np.percentile(points @ axes, [trimmed, 100.0 - trimmed], axis=0)
        if np.prod(high - low) < least:
            best, least = Rectangle(low, high, axes), float(np.prod(high - low))
    return best


def find_tight_rectangles(outline: Float[np.ndarray, "P 2"]) -> list[Rectangle]:
    """Return rectangles much like a convex outline.

    Each side lies at the outermost corner, or half way to the far end of the edge that is there.
    """
    found = []
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(edges, axis=1)
    for edge in edges[lengths > _LONG_EDGE * lengths.max()]:
        axes = _align(edge)
        places = outline @ axes
        sides = [_find_levels(places, axis, sign) for axis, sign in product(range(2), (-1.0, 1.0))]
        for x0, x1, y0, y1 in product(*sides):
            found.append(Rectangle(np.array([x0, y0]), np.array([x1, y1]), axes))
    return found


def _align(edge: Float[np.ndarray, " 2"]) -> Float[np.ndarray, "2 2"]:
    """Return axes (columns), the first along an edge."""
    along = edge / np.linalg.norm(edge)
    return np.column_stack([along, [-along[1], along[0]]])


def _find_levels(places: Float[np.ndarray, "P 2"], axis: int, sign: float) -> list[float]:
    """Return where a rectangle may end in one direction: at the outermost corner, at the middle of its edge."""
    following = np.roll(places, -1, axis=0)
    level, after = sign * places[:, axis], sign * following[:, axis]
    run = np.abs(places[:, 1 - axis] - following[:, 1 - axis])
    middle = (level + after) / 2
    is_side = run > _LONG_SIDE * np.ptp(places[:, 1 - axis])
    side = int(np.argmax(np.where(is_side, middle, -np.inf)))
    return sorted({sign * float(level.max()), sign * float(middle[side])}, key=lambda v: -sign * v)
