"""Convex solids as intersections of half-spaces."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from reconstruction._src.geometry.outlines import compute_hull_outline
from reconstruction._src.geometry.rows import compute_areas, make_hull

STEEP = 0.34
"""A plane whose unit normal rises less than this (it is steeper than 70 degrees) is a side or a wall, not ground."""
_SAME_NORMAL = 1e-4
"""Normals that differ by less, relative to the size of the solid [1/m], are those of one face that Qhull split."""
_LEVEL = 1e-6  # A unit normal that rises less belongs to a vertical plane: rounding, not slope
_ON_SIDE = 1e-9  # A point this close to a vertical plane lies on it [m]
_SMALLEST_BALL = 1e-4
"""Solids whose largest inner ball is smaller are flat: Qhull finds no corners of them [m]."""
_LARGEST_BALL = 100.0  # Bounds the linear program where a solid is open [m]
_FARTHEST = 1e4  # A corner farther from the inner point shows that the solid is open [m]
_LEAST_VOLUME = 1e-6  # A prism with less is flat [m³]; MuJoCo refuses those
_DIGITS = 6  # Corners are rounded to 1 µm, so that one where many planes meet is one


def compute_halfspaces(piece: trimesh.Trimesh) -> Float[np.ndarray, "H 4"]:
    """Return the half-spaces of a convex solid: inside is a x + b y + c z + d <= 0; large faces first."""
    hull = ConvexHull(np.asarray(piece.vertices, dtype=np.float64))
    areas = compute_areas(hull.points, hull.simplices)
    size = float(np.linalg.norm(hull.points - hull.points.mean(axis=0), axis=1).max())
    kept: list[np.ndarray] = []
    for normal in hull.equations[np.argsort(-areas, kind="stable"), :3]:
        if all(np.abs(normal - other[:3]).max() > _SAME_NORMAL / size for other in kept):
            kept.append(np.append(normal, -(hull.points @ normal).max()))
    return np.array(kept)


def find_inner_point(halfspaces: Float[np.ndarray, "H 4"]) -> Float[np.ndarray, " 3"] | None:
    """Return the point farthest inside (center of the largest ball); None where there is no inside.

    References:
        Boyd, Vandenberghe (2004), Convex optimization, section 8.5.1: the Chebyshev center, a linear program.
    """
    size = np.linalg.norm(halfspaces[:, :3], axis=1)
    result = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.concatenate([halfspaces[:, :3], size[:, None]], axis=1),
        b_ub=-halfspaces[:, 3],
        bounds=[(None, None)] * 3 + [(0.0, _LARGEST_BALL)],
    )
    return result.x[:3] if result.status == 0 and result.x[3] > _SMALLEST_BALL else None


def make_solid(
    halfspaces: Float[np.ndarray, "H 4"], inner: Float[np.ndarray, " 3"] | None
) -> trimesh.Trimesh | None:
    """Return the solid within half-spaces around a point inside; None where it is empty, open or flat."""
    if inner is None:
        return None
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            corners = HalfspaceIntersection(halfspaces, inner).intersections
    except (QhullError, ValueError):
        return None
    if not np.isfinite(corners).all() or np.abs(corners - inner).max() > _FARTHEST:
        return None
    return make_hull(np.unique(np.round(corners, _DIGITS), axis=0))


def make_prism(
    bounds: Float[np.ndarray, "B 3"], tops: Float[np.ndarray, "K 4"], bottom: float
) -> trimesh.Trimesh | None:
    """Return the convex solid above `bottom`, within bounds in plan, beneath all of some planes."""
    sides = np.stack([bounds[:, 0], bounds[:, 1], np.zeros(len(bounds)), -bounds[:, 2]], axis=1)
    halfspaces = np.concatenate([sides, tops, [[0.0, 0.0, -1.0, bottom]]])
    solid = make_solid(halfspaces, find_inner_point(halfspaces))
    return solid if solid is not None and solid.volume > _LEAST_VOLUME else None


def compute_tops(
    halfspaces: Float[np.ndarray, "H 4"], points: Float[np.ndarray, "N 2"]
) -> Float[np.ndarray, " N"]:
    """Return the height of a solid's top at points (x, y) [m]; -inf outside of it in plan."""
    rise = halfspaces[:, 2]
    level = points @ halfspaces[:, :2].T + halfspaces[:, 3]
    is_up, is_down = rise > _LEVEL, rise < -_LEVEL
    top = (-level[:, is_up] / rise[is_up]).min(axis=1, initial=np.inf)
    bottom = (-level[:, is_down] / rise[is_down]).max(axis=1, initial=-np.inf)
    is_inside = (level[:, ~(is_up | is_down)] <= _ON_SIDE).all(axis=1) & (top >= bottom)
    return np.where(is_inside, top, -np.inf)


_RIGHT_ANGLE = 1e-5  # Cosine between edges that still counts as a right angle: pieces are saved to 1 µm
_CORNER_TOLERANCE = 5e-6
"""How far a corner may lie from that of the box [m]: a few times the 1 µm to which pieces are saved."""
_LONG_EDGE = 0.25  # Edges of an outline shorter than this share of the longest give a rectangle no direction
_LONG_SIDE = 0.3  # An edge that runs along less than this share of a side is a bevelled corner, not the side


class Rectangle(NamedTuple):
    """A rectangle in a plane."""

    low: Float[np.ndarray, " 2"]  # lower corner, along the axes
    high: Float[np.ndarray, " 2"]  # upper corner
    axes: Float[np.ndarray, "2 2"]  # unit vectors in columns


class Box(NamedTuple):
    """A box in space."""

    center: Float[np.ndarray, " 3"]  # [m]
    half_sizes: Float[np.ndarray, " 3"]  # [m]
    axes: Float[np.ndarray, "3 3"]  # unit vectors in columns, right-handed


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
    outline = compute_hull_outline(points)
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
