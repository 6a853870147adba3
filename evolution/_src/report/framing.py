"""What a picture of an arena shows: the scene without what trails far off it, and the route in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

import symbrion_gym as sg

if TYPE_CHECKING:
    from symbrion_gym._src.tasks.drivable_way import Pair
    from symbrion_gym._src.traversability.routes import DrivingRoute

_TAIL = 2.5
"""The scene is what lies between this percentile and its opposite along each axis [%] ..."""
_BEYOND = 0.5
"""... and this share of it beyond: even ground keeps its rims, and flaps of a few far points are cut off."""
_SMALL = 0.3
"""A route that extends over less than this share of the scene is framed itself ..."""
_AROUND = 1.0
"""... with as much ground around it, relative to its extent, on each side, and at least `_LEAST_AROUND`."""
_LEAST_AROUND = 1.0
"""[m]"""


def find_frame(
    arena: sg.Arena, route: DrivingRoute | None = None, way: Pair | None = None
) -> Float[np.ndarray, "N 3"]:
    """Return the points that a picture of an arena shows: vertices of its surface, and the route."""
    vertices = np.asarray(arena.surface.vertices, dtype=np.float64)
    low, high = np.percentile(vertices, [_TAIL, 100.0 - _TAIL], axis=0)
    reach = _BEYOND * np.maximum(high - low, 0.2 * (high - low).max())
    low, high = low - reach, high + reach
    if route is None and way is None:
        return _crop(vertices, low, high)
    shown = np.empty((0, 3)) if route is None else route.path
    if way is not None:
        height = np.median(vertices if route is None else shown, axis=0)[2]
        shown = np.concatenate([shown, np.column_stack([np.array(way), np.full(2, height)])])
    begin, end = shown.min(axis=0), shown.max(axis=0)
    extent = float((end - begin)[:2].max())
    if extent < _SMALL * float((high - low)[:2].max()):
        around = max(_AROUND * extent, _LEAST_AROUND)
        low, high = np.maximum(low, begin - around), np.minimum(high, end + around)
    return np.concatenate([_crop(vertices, low, high), shown])


def _crop(
    points: Float[np.ndarray, "N 3"], low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "M 3"]:
    """Return the points in a box; all where there are too few in it to show."""
    is_inside = ((points >= low) & (points <= high)).all(axis=1)
    return points[is_inside] if is_inside.sum() >= 3 else points
