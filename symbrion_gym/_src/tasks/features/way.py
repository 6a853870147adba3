"""The straight way across a surface, with the width on which it can be driven, found on the surface alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_positive
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_smallest_rectangle
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import OptionError, TaskError

Line = tuple[tuple[float, float], tuple[float, float]]
"""A line across the way: (x, y) of its right and of its left end [m]."""
_LOOKS_UP = 0.1  # Faces whose normal has a larger z component are ground or its steepest slopes
_LIES_UNDER = 0.10  # Ground this far below the highest surface lies under something [m]
_WHOLE = 0.01
"""The middle of a way is a multiple of this [m]: a scan is not more exact, and a course scanned along x keeps y = 0."""
_SAME_HEADING = float(np.deg2rad(0.5))
"""A way this close to an axis of the world runs along it [rad]: the sides of a scan are not more exact."""


@dataclass(frozen=True)
class WaySearch:
    """How a way is looked at.

    Raises:
        OptionError: a number is out of range.
    """

    step: float = 0.01  # spacing of heights along the way [m]
    lane: float = 0.05  # spacing of heights across it [m]
    middle: float = 0.3  # lanes up to this far from the middle give the profile of the way [m]
    unevenness: float = 0.06  # a lane leaves the way where its ground differs from the profile by more [m]
    # a lane belongs to the way where it has the ground of the profile for this share of its length
    share: float = 0.85
    covered: float = 0.05  # a way is not open where more than this share of it lies under something
    unseen: float = 0.2  # a way is no ground where more than this share of it is not on the surface
    max_samples: int = 2000  # heights are spaced wider where there would be more along the way, or across it

    def __post_init__(self) -> None:
        check_positive(self, [each.name for each in fields(self)], OptionError)


@dataclass(frozen=True)
class Way:
    """A straight way; s is measured along it, from the foot of the perpendicular from the world's origin."""

    heading: float  # direction, as rotation about z [rad]
    lateral: float  # offset of its middle to the left of the origin [m]
    half_width: float  # half of the width on which its ground continues to both sides [m]
    begin: float  # s where the surface begins [m]
    end: float  # s where it ends [m]

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (x, y)."""
        return float(np.cos(self.heading)), float(np.sin(self.heading))

    @property
    def width(self) -> float:
        """Width of the drivable ground [m]."""
        return 2 * self.half_width

    def place(self, s: np.ndarray | float, left: np.ndarray | float = 0.0) -> tuple[Any, Any]:
        """Return x and y in the world [m] of positions along the way and to its left [m]."""
        return place_along(self.heading, self.lateral, s, left)

    def find_line(self, s: float) -> Line:
        """Return the line across the whole way at s [m]."""
        (x0, x1), (y0, y1) = self.place(s, np.array([-self.half_width, self.half_width]))
        return (float(x0), float(y0)), (float(x1), float(y1))


@dataclass(frozen=True)
class Profile:
    """Heights along and across a way."""

    arena: Arena  # the arena
    way: Way  # the way
    s: Float[np.ndarray, " D"]  # positions along it [m]
    left: Float[np.ndarray, " L"]  # offsets of the lanes to the left of its middle [m]
    heights: Float[np.ndarray, "D L"]  # ground [m]; nan where there is none
    # height of the way: median of the middle lanes; where nothing was seen, that before it [m]
    middle: Float[np.ndarray, " D"]

    @property
    def on_way(self) -> Bool[np.ndarray, " L"]:
        """The lanes within the width of the way."""
        return np.abs(self.left) <= self.way.half_width + 1e-9

    def read(self, s: Float[np.ndarray, " N"], left: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Return the height of the surface at positions along and left of the way [m]; nan where there is none."""
        return self.arena.height(*self.way.place(s, left))


def place_along(
    heading: float, lateral: float, s: np.ndarray | float, left: np.ndarray | float = 0.0
) -> tuple[Any, Any]:
    """Return x and y in the world of positions along a straight way and to its left [m]."""
    c, n = float(np.cos(heading)), float(np.sin(heading))
    across = lateral + left
    return c * s - n * across, n * s + c * across


def find_way(
    arena: Arena,
    direction: Sequence[float] | np.ndarray | None = None,
    search: WaySearch | None = None,
    start: Sequence[float] | np.ndarray | None = None,
) -> Way:
    """Find the straight way across a surface, and the width of its ground."""
    return read_profile(arena, direction, search, start).way


def read_profile(
    arena: Arena,
    direction: Sequence[float] | np.ndarray | None = None,
    search: WaySearch | None = None,
    start: Sequence[float] | np.ndarray | None = None,
) -> Profile:
    """Read the heights along the straight way across a surface; arguments as `find_way`."""
    search = search or WaySearch()
    points = np.asarray(arena.surface.vertices, dtype=np.float64)[:, :2]
    heading, middle = _find_axis(points, arena.name)
    heading = heading if direction is None else _read_direction(direction)
    axes = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    low, high = (points @ axes).min(axis=0), (points @ axes).max(axis=0)
    if start is None:
        lateral = round(float((middle @ axes)[1]) / _WHOLE) * _WHOLE + 0.0
    else:
        low[0], lateral = (float(value) for value in np.asarray(start, dtype=np.float64)[:2] @ axes)
    step = max(search.step, float(high[0] - low[0]) / search.max_samples)
    lane = max(search.lane, float(high[1] - low[1]) / search.max_samples)
    s = np.arange(low[0], high[0] + step / 2, step)
    reach = int(max(high[1] - lateral, lateral - low[1]) / lane)
    left = lane * np.arange(-reach, reach + 1)
    x, y = place_along(heading, lateral, s[:, None], left)
    heights = arena.height(x, y)
    is_middle = np.abs(left) <= search.middle
    profile = _read_middle(heights[:, is_middle], arena.name, search)
    _refuse_covered(arena, x[:, is_middle], y[:, is_middle], search)
    half_width = _compute_half_width(heights, profile, left, search)
    half_width += _widen(arena, (heading, lateral, half_width), s, profile, lane, search)
    way = Way(heading, lateral, half_width, float(low[0]), float(high[0]))
    return Profile(arena, way, s, left, heights, profile)


def _find_axis(points: Float[np.ndarray, "V 2"], name: str) -> tuple[float, Float[np.ndarray, " 2"]]:
    """Return the heading of the longer side of the smallest rectangle around points [rad], and its middle [m]."""
    rectangle = find_smallest_rectangle(points, 0.0)
    if rectangle is None:
        raise TaskError(f"arena {name!r} has no surface to cross; give another arena")
    extent = rectangle.high - rectangle.low
    along = rectangle.axes[:, 0 if extent[0] >= extent[1] else 1]
    heading = float(np.arctan2(along[1], along[0]))
    heading = (heading + np.pi / 2 - 1e-9) % np.pi - np.pi / 2 + 1e-9  # towards larger x, else larger y
    quarter = round(heading / (np.pi / 2)) * (np.pi / 2)
    heading = quarter if abs(heading - quarter) < _SAME_HEADING else heading
    return abs(heading) if abs(heading) == np.pi / 2 else heading, rectangle.axes @ (
        (rectangle.low + rectangle.high) / 2
    )


def _read_direction(direction: Sequence[float] | np.ndarray) -> float:
    """Return the heading of a direction [rad]."""
    vector = np.asarray(direction, dtype=np.float64).ravel()
    if len(vector) != 2 or not np.isfinite(vector).all() or not vector.any():
        raise TaskError(f"direction must be (x, y), not (0, 0), got {direction!r}")
    return float(np.arctan2(vector[1], vector[0]))


def _read_middle(heights: Float[np.ndarray, "D M"], name: str, search: WaySearch) -> Float[np.ndarray, " D"]:
    """Return the median of the lanes; gaps in the scan take the height before them."""
    is_seen = np.isfinite(heights).any(axis=1)
    if is_seen.mean() < 1.0 - search.unseen:
        raise TaskError(
            f"the way across arena {name!r} has no surface on {100 * (1 - is_seen.mean()):.0f} % of "
            "its length; give a direction, or start and goal"
        )
    profile = np.zeros(len(heights))
    profile[is_seen] = np.nanmedian(heights[is_seen], axis=1)
    profile[: int(np.argmax(is_seen))] = profile[int(np.argmax(is_seen))]
    return profile[np.maximum.accumulate(np.where(is_seen, np.arange(len(profile)), int(np.argmax(is_seen))))]


def _refuse_covered(
    arena: Arena, x: Float[np.ndarray, "D M"], y: Float[np.ndarray, "D M"], search: WaySearch
) -> None:
    """Refuse a way on top of something: what looks up lies below it."""
    up = np.flatnonzero(arena.surface.face_normals[:, 2] > _LOOKS_UP)
    ground = Elevation(trimesh.Trimesh(arena.surface.vertices, arena.surface.faces[up], process=False))
    every = max(1, round(search.lane / search.step))
    x, y = x[::every], y[::every]
    below = ground.height_below(x, y, arena.height(x, y) - _LIES_UNDER)
    share = float(np.isfinite(below).mean())
    if share > search.covered:
        raise TaskError(
            f"something hangs above {100 * share:.0f} % of the way across arena {arena.name!r}, as in a "
            "room; give start and goal"
        )


def _compute_half_width(
    heights: Float[np.ndarray, "D L"],
    profile: Float[np.ndarray, " D"],
    left: Float[np.ndarray, " L"],
    search: WaySearch,
) -> float:
    """Return how many lanes on both sides of the middle have the ground of the profile, as a distance [m]."""
    is_good = _find_same(heights, profile, search)
    middle = len(left) // 2
    count = min(int(np.argmin(np.append(side, False))) for side in (is_good[middle::-1], is_good[middle:]))
    return float(left[middle + max(count, 1) - 1])


def _widen(
    arena: Arena,
    way: tuple[float, float, float],
    s: Float[np.ndarray, " D"],
    profile: Float[np.ndarray, " D"],
    lane: float,
    search: WaySearch,
) -> float:
    """Return how much farther than the last lane its ground goes on to both sides [m]."""
    heading, lateral, half_width = way
    more = np.arange(1, max(2, round(lane / search.step))) * search.step
    left = half_width + more
    x, y = place_along(heading, lateral, s[:, None], np.concatenate([-left, left]))
    is_good = _find_same(arena.height(x, y), profile, search).reshape(2, -1).all(axis=0)
    return float(np.append(0.0, more)[int(np.argmin(np.append(is_good, False)))])


def _find_same(
    heights: Float[np.ndarray, "D L"], profile: Float[np.ndarray, " D"], search: WaySearch
) -> Bool[np.ndarray, " L"]:
    """Return which lanes have the ground of the profile for the greater part of its length."""
    with np.errstate(invalid="ignore"):
        is_same = np.abs(heights - profile[:, None]) < search.unevenness
    return is_same.mean(axis=0) >= search.share
