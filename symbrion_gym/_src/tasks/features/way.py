"""The straight way across a surface, its ground, and edges across it, found on the surface alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_smallest_rectangle
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError

Direction = Sequence[float] | np.ndarray  # (x, y), of any length
STEP = 0.01  # Spacing of the heights along a way [m]
LANE = 0.05  # Spacing of the heights across it [m]
_MAX_SAMPLES = 2000  # Heights are spaced wider where there would be more along a way, or across it
_MIDDLE = 0.3  # Lanes up to this far from the middle give the profile of the way [m]
_UNEVENNESS = 0.06  # A lane leaves the way where its ground differs from the profile by more [m]
_SHARE = 0.85  # A lane belongs to the way that has the ground of the profile on this share of its length
_COVERED = 0.05  # A way is not open where more than this share of it lies under something
_UNSEEN = 0.2  # A way is no ground where more than this share of it is not on the surface
_LOOKS_UP = 0.1  # Faces whose normal has a larger z component are ground or its steepest slopes
LIES_UNDER = 0.10
"""Ground this far below the highest surface lies under something [m]: contact and surface differ by less."""
_WHOLE = 0.01
"""The middle of a way is a multiple of this [m]: a scan is not more exact, and a course scanned along x keeps y = 0."""
_SAME_HEADING = float(np.deg2rad(0.5))
"""A way this close to an axis of the world runs along it [rad]: the sides of a scan are not more exact."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A straight line in plan; s is measured along it, from the foot of the perpendicular from the world's origin."""

    heading: float  # direction, as rotation about z [rad]
    lateral: float  # offset to the left of the origin [m]

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (x, y)."""
        return float(np.cos(self.heading)), float(np.sin(self.heading))

    def place(self, s: np.ndarray | float, left: np.ndarray | float = 0.0) -> tuple[Any, Any]:
        """Return x and y in the world [m] of positions along the line and to its left [m]."""
        (c, n), across = self.direction, self.lateral + left
        return c * s - n * across, n * s + c * across


@dataclass(frozen=True, kw_only=True)
class Way(Line):
    """The middle of a straight way across a surface."""

    half_width: float  # half of the width on which its ground continues to both sides [m]
    begin: float  # s where the surface begins [m]
    end: float  # s where it ends [m]

    @property
    def width(self) -> float:
        """Width of the drivable ground [m]."""
        return 2 * self.half_width


class Profile(NamedTuple):
    """Heights along and across a way."""

    arena: Arena  # the arena
    way: Way  # the way
    s: Float[np.ndarray, " D"]  # positions along it [m]
    left: Float[np.ndarray, " L"]  # offsets of the lanes to the left of its middle [m]
    heights: Float[np.ndarray, "D L"]  # ground [m]; nan where there is none
    # height of the way: median of the middle lanes; where nothing was seen, that before it [m]
    middle: Float[np.ndarray, " D"]

    @property
    def lanes(self) -> Int[np.ndarray, " W"]:
        """The numbers of the lanes within the width of the way."""
        return np.flatnonzero(np.abs(self.left) <= self.way.half_width + 1e-9)


def read_profile(
    arena: Arena, direction: Direction | None = None, start: Sequence[float] | np.ndarray | None = None
) -> Profile:
    """Read the heights along the straight way across a surface: along its longer side, unless a direction is given,
    and through its middle, unless it starts at a place (x, y)."""
    points = np.asarray(arena.surface.vertices, dtype=np.float64)[:, :2]
    heading, middle = _find_axis(points, arena.name)
    heading = heading if direction is None else _read_direction(direction)
    axes = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    low, high = (points @ axes).min(axis=0), (points @ axes).max(axis=0)
    if start is None:
        lateral = round(float((middle @ axes)[1]) / _WHOLE) * _WHOLE + 0.0
    else:
        low[0], lateral = (float(value) for value in np.asarray(start, dtype=np.float64)[:2] @ axes)
    step = max(STEP, float(high[0] - low[0]) / _MAX_SAMPLES)
    lane = max(LANE, float(high[1] - low[1]) / _MAX_SAMPLES)
    s = np.arange(low[0], high[0] + step / 2, step)
    reach = int(max(high[1] - lateral, lateral - low[1]) / lane)
    left = lane * np.arange(-reach, reach + 1)
    line = Line(heading=heading, lateral=lateral)
    x, y = line.place(s[:, None], left)
    heights = arena.height(x, y)
    is_middle = np.abs(left) <= _MIDDLE
    profile = _read_middle(heights[:, is_middle], arena.name)
    _refuse_covered(arena, x[:, is_middle], y[:, is_middle])
    is_good = _find_same(heights, profile)
    sides = is_good[reach::-1], is_good[reach:]
    half_width = float(left[reach + max(min(_count_first(side) for side in sides), 1) - 1])
    # How much farther than the last lane the ground goes on to both sides.
    more = np.arange(1, max(2, round(lane / STEP))) * STEP
    beyond = line.place(s[:, None], np.concatenate([-half_width - more, half_width + more]))
    right, left_too = _find_same(arena.height(*beyond), profile).reshape(2, -1)
    half_width += float(np.append(0.0, more)[_count_first(right & left_too)])
    way = Way(
        heading=heading, lateral=lateral, half_width=half_width, begin=float(low[0]), end=float(high[0])
    )
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
    middle = rectangle.axes @ ((rectangle.low + rectangle.high) / 2)
    return abs(heading) if abs(heading) == np.pi / 2 else heading, middle


def _read_direction(direction: Direction) -> float:
    """Return the heading of a direction [rad]."""
    vector = np.asarray(direction, dtype=np.float64).ravel()
    if len(vector) != 2 or not np.isfinite(vector).all() or not vector.any():
        raise TaskError(f"direction must be (x, y), not (0, 0), got {direction!r}")
    return float(np.arctan2(vector[1], vector[0]))


def _read_middle(heights: Float[np.ndarray, "D M"], name: str) -> Float[np.ndarray, " D"]:
    """Return the median of the lanes; gaps in the scan take the height before them."""
    is_seen = np.isfinite(heights).any(axis=1)
    if is_seen.mean() < 1.0 - _UNSEEN:
        raise TaskError(
            f"the way across arena {name!r} has no surface on {100 * (1 - is_seen.mean()):.0f} % of its length; give a "
            "direction, or start and goal"
        )
    profile = np.zeros(len(heights))
    profile[is_seen] = np.nanmedian(heights[is_seen], axis=1)
    return profile[np.maximum.accumulate(np.where(is_seen, np.arange(len(profile)), np.argmax(is_seen)))]


def _refuse_covered(arena: Arena, x: Float[np.ndarray, "D M"], y: Float[np.ndarray, "D M"]) -> None:
    """Refuse a way on top of something: what looks up lies below it."""
    up = np.flatnonzero(arena.surface.face_normals[:, 2] > _LOOKS_UP)
    ground = Elevation(trimesh.Trimesh(arena.surface.vertices, arena.surface.faces[up], process=False))
    every = round(LANE / STEP)
    x, y = x[::every], y[::every]
    share = float(np.isfinite(ground.height_below(x, y, arena.height(x, y) - LIES_UNDER)).mean())
    if share > _COVERED:
        raise TaskError(
            f"something hangs above {100 * share:.0f} % of the way across arena {arena.name!r}, as in a room; give "
            "start and goal"
        )


def _find_same(heights: Float[np.ndarray, "D L"], profile: Float[np.ndarray, " D"]) -> Bool[np.ndarray, " L"]:
    """Return which lanes have the ground of the profile for the greater part of its length."""
    with np.errstate(invalid="ignore"):
        return (np.abs(heights - profile[:, None]) < _UNEVENNESS).mean(axis=0) >= _SHARE


def _count_first(is_good: Bool[np.ndarray, " L"]) -> int:
    """Return how many lanes are good before the first that is not."""
    return int(np.argmin(np.append(is_good, False)))


LEAST_LANES = 3  # A line across a way is drawn through at least as many lanes
WALL_STEPS = 4  # The height of a wall is gained or lost within as many steps, as scanned walls lean
AGREEMENT = 0.6  # Share of the lanes that have to show an edge; where fewer do, a body drives around it
_NEAR = 0.05  # A lane shows an edge where it jumps this close to the line through the others [m]
_HALVINGS = 7  # Intervals of 1 cm are halved as often: 0.1 mm


class Jump(NamedTuple):
    """A jump of the ground along a lane: it changes like a wall."""

    first: int  # sample before it
    last: int  # sample after it
    rise: float  # what the ground gains there [m]; below 0 for a fall


class Edge(NamedTuple):
    """An edge across a way."""

    s: float  # where it crosses the middle of the way [m]
    skew: float  # gain of s to the left: tangent of the angle from the perpendicular of the way
    share: float  # share of the lanes that show it
    spread: float  # median distance of where they show it from the edge [m]


def find_jumps(heights: Float[np.ndarray, " D"], least: float) -> list[Jump]:
    """Return the jumps along a lane of more than a height [m], in order."""
    change = heights[WALL_STEPS:] - heights[:-WALL_STEPS]
    jumps = []
    for sign in (-1.0, 1.0):
        for run in split_runs(sign * change > least):
            first, last = int(run[0]), int(run[-1]) + WALL_STEPS
            if len(run) <= 2 * WALL_STEPS:  # what goes on like this is a slope
                jumps.append(Jump(first, last, float(heights[last] - heights[first])))
    return sorted(jumps)


def split_runs(mask: Bool[np.ndarray, " D"]) -> list[Int[np.ndarray, " R"]]:
    """Return the numbers of samples where something is so, each run of neighbors by itself."""
    at = np.flatnonzero(mask)
    return np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if len(at) else []


def find_edge(
    profile: Profile,
    lanes: Int[np.ndarray, " W"],
    jumps: Sequence[tuple[int, int]],
    levels: Float[np.ndarray, " W"],
) -> Edge | None:
    """Return the line through the places where lanes pass levels [m] between two samples of each; None where fewer
    than three agree.

    Theil-Sen: the median slope between two lanes, then least squares over the lanes within 5 cm.
    """
    places = _find_crossings(profile, lanes, jumps, levels)
    known = np.isfinite(places)
    x, y = profile.left[lanes[known]], places[known]
    if len(x) < LEAST_LANES:
        return None
    first, second = np.triu_indices(len(x), 1)
    skew = float(np.median((y[second] - y[first]) / (x[second] - x[first])))
    offset = float(np.median(y - skew * x))
    is_near = np.abs(y - skew * x - offset) < _NEAR
    if is_near.sum() < LEAST_LANES:
        return None
    skew, offset = (float(value) for value in np.polyfit(x[is_near], y[is_near], 1))
    share = float(is_near.sum()) / len(profile.lanes)
    return Edge(offset, skew, share, float(np.median(np.abs(y - offset - skew * x))))


def _find_crossings(
    profile: Profile,
    lanes: Int[np.ndarray, " W"],
    jumps: Sequence[tuple[int, int]],
    levels: Float[np.ndarray, " W"],
) -> Float[np.ndarray, " W"]:
    """Return s where lanes pass levels, to 0.1 mm [m]; nan where they do not, the middle one of several passes."""
    low, high = np.full((2, len(lanes)), np.nan)
    for row, (lane, (first, last), level) in enumerate(zip(lanes, jumps, levels, strict=True)):
        window = profile.heights[first : last + 1, lane] - level
        is_below = np.where(np.isnan(window), np.nan, window < 0.0)
        passes = np.flatnonzero(np.abs(np.diff(is_below)) == 1.0)
        if len(passes):
            sample = first + int(passes[len(passes) // 2])
            low[row], high[row] = profile.s[sample], profile.s[sample + 1]
    known = np.isfinite(low)
    left = profile.left[lanes[known]]

    def is_above(s: Float[np.ndarray, " K"]) -> Bool[np.ndarray, " K"]:
        return profile.arena.height(*profile.way.place(s, left)) >= levels[known]

    a, b = low[known], high[known]
    is_falling = is_above(a)
    for _ in range(_HALVINGS):
        middle = (a + b) / 2
        is_before = is_above(middle) == is_falling
        a, b = np.where(is_before, middle, a), np.where(is_before, b, middle)
    low[known] = (a + b) / 2
    return low
