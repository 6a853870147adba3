"""Where an organism starts in an arena, which way it goes, and where it has arrived."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_not_negative, check_positive, format_extents
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.errors import ArenaError, OptionError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.tasks.features.gap import Gap, GapSearch, find_gap
from symbrion_gym._src.tasks.features.way import place_along
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import (
    Place,
    find_standing_place,
    find_straight_way,
    find_straight_way_from,
    read_place,
)

_STOREY = 0.25  # A given z is that of ground no farther above or below than this [m]
_LIES_UNDER = 0.10
"""Ground this far below the highest surface lies under something [m]: contact and surface differ by less."""
_WALL = 0.30
"""What rises by more than this within `_SAMPLES` is a wall [m]: higher than steps and plateaus that snakes climb."""
_SAMPLES = 0.05  # Spacing of heights along a way [m]
_LEAST_WAY = 0.3  # A chosen way has at least this length beside that of the organism [m]
_BEYOND = 0.5  # An organism is laid down on the ground up to this far beyond its ends [m]
_END_ROOM = 0.10
"""Room for the nose and the tail at the ends of a chosen way [m]: a module reaches 0.07 ahead of its center."""


class Ends(NamedTuple):
    """Start and goal of a straight way."""

    start: Float[np.ndarray, " 2"]  # (x, y) of the head at the start [m]
    goal: Float[np.ndarray, " 2"]  # (x, y) of the head at the goal [m]
    # z of the ground at the start where something lies above it [m]; None where it is the highest
    start_height: float | None = None


def find_ends(
    arena: Arena, organism: Organism, middle_way: Ends, start: Place | None, goal: Place | None
) -> Ends:
    """Return start and goal on the ground; what is not given is chosen.

    The way through the middle is kept where it is open to the sky and no wall stands on it; elsewhere, as in a room,
    about the longest straight way over walkable ground is chosen.
    """
    for name, place in (("start", start), ("goal", goal)):
        if place is not None:
            _check_inside(arena, name, place)
    footprint = Footprint.of(organism, arena.friction)
    ground = arena.traversability(replace(footprint, radius=footprint.width / 2))
    first = None if start is None else find_standing_place(ground, "start", start, arena.name, _STOREY)
    last = None if goal is None else find_standing_place(ground, "goal", goal, arena.name, _STOREY)
    is_open = _is_open(arena, ground, middle_way) if first is None or last is None else False
    length = (organism.num_modules - 1) * organism.scout.pitch
    if first is None and last is None:
        return middle_way if is_open else _choose_both(arena, ground, length)
    if goal is None and first is not None:
        goal = middle_way.goal if is_open else _find_far(ground, first, 0.0)
    elif start is None and last is not None:
        start = middle_way.start if is_open else _find_far(ground, last, length)
    return _make_ends(arena, ground, start, goal, length)


def _check_inside(arena: Arena, name: str, place: Place) -> None:
    """Refuse a place outside of the surface as seen from above, before the ground is mapped, which takes long."""
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)[:, :2]
    point = np.asarray(place, dtype=np.float64).ravel()[:2]
    if (point < low).any() or (point > high).any():
        raise ArenaError(
            f"the {name} {tuple(point.tolist())} lies outside of arena {arena.name!r}, which extends over "
            f"{format_extents(low.tolist(), high.tolist())}"
        )


def _is_open(arena: Arena, ground: TraversabilityMap, way: Ends) -> bool:
    """Return whether both ends lie on ground under the open sky and no wall stands between them."""
    count = int(np.ceil(np.linalg.norm(way.goal - way.start) / _SAMPLES)) + 1
    line = np.linspace(way.start, way.goal, count)
    heights = arena.height(line[:, 0], line[:, 1])
    if not np.isfinite(heights[[0, -1]]).all():
        return False
    for end in (0, -1):
        cell = ground.grid.compute_cells(line[[end]])
        near = ground.sorted_heights.find_nearest(cell, heights[[end]])[0]
        if near < 0 or abs(ground.height[near] - heights[end]) > _LIES_UNDER:
            return False
    return not (np.diff(heights[np.isfinite(heights)]) > _WALL).any()


def _choose_both(arena: Arena, ground: TraversabilityMap, length: float) -> Ends:
    way = find_straight_way(ground, ground.region == 0)
    reach = 0.0 if way is None else float(np.linalg.norm((way[1] - way[0])[:2])) - 2 * _END_ROOM
    if way is None or reach < length + _LEAST_WAY:
        raise ArenaError(
            f"arena {arena.name!r} has no straight way of {length + _LEAST_WAY:.2f} m for this organism (the longest "
            f"has {max(reach, 0.0):.2f} m); give fewer modules, or start and goal"
        )
    back, end = way[0][:2], way[1][:2]
    along = (end - back) / (reach + 2 * _END_ROOM)
    first = _find_nearest(ground, back + along * (length + _END_ROOM))
    return _make_ends(arena, ground, first, end - along * _END_ROOM, length)


def _find_nearest(ground: TraversabilityMap, point: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 3"]:
    """Return the place of the largest region that is nearest to a point in plan [m]."""
    places = ground.positions[ground.region == 0]
    return places[int(np.argmin(np.linalg.norm(places[:, :2] - point, axis=1)))]


def _find_far(ground: TraversabilityMap, known: int, length: float) -> Float[np.ndarray, " 2"]:
    """Return a place as far as possible on a straight way from a known one, but for room for a length at its end."""
    is_usable = ground.is_drivable.copy()
    is_usable[known] = True
    far = find_straight_way_from(ground, is_usable, known)[:2]
    way = ground.positions[known, :2] - far
    reach = float(np.linalg.norm(way))
    return far + way * min((length + _END_ROOM) / max(reach, _SAMPLES), 0.5)


def _make_ends(
    arena: Arena, ground: TraversabilityMap, start: Place | None, goal: Place | None, length: float
) -> Ends:
    assert start is not None
    first = find_standing_place(ground, "start", start, arena.name, _STOREY)
    begin, end = (np.asarray(place, dtype=np.float64).ravel()[:2] for place in (start, goal))
    height = float(ground.height[first])
    return Ends(begin, end, height if _lies_under(arena, begin, end, height, length) else None)


def _lies_under(
    arena: Arena, begin: Float[np.ndarray, " 2"], end: Float[np.ndarray, " 2"], height: float, length: float
) -> bool:
    """Return whether something hangs above a straight organism that stands with its head at the start."""
    way = end - begin
    ahead = way / max(float(np.linalg.norm(way)), _SAMPLES)
    line = begin + np.arange(-length - _BEYOND, _BEYOND, _SAMPLES)[:, None] * ahead
    highest = arena.height(line[:, 0], line[:, 1])
    below = arena.elevation.height_below(line[:, 0], line[:, 1], height + _STOREY)
    hangs = (highest > height + _STOREY) & ~(highest - below <= _LIES_UNDER)
    is_below = abs(float(arena.height(begin[0], begin[1])) - height) > _LIES_UNDER
    return is_below or bool(hangs.any())


Point = Sequence[float] | np.ndarray  # (x, y) in the world, or (x, y, z) where there are several storeys [m]
StartName = Literal["floor", "pit"]  # Before the ramp or step, or before the pit
_SAME_PLACE = 1e-3  # Two points closer than this have no direction from one to the other [m]


@dataclass(frozen=True)
class RouteMargins:
    """Distances between the ends of a route and ramp, pit and rim.

    Raises:
        OptionError: a distance is negative.
    """

    # distance between the front of the head at the start and the foot of the ramp or step [m]
    before_foot: float = 0.10
    before_pit: float = 0.20  # distance between the front of the head and the pit at the start "pit" [m]
    # distance between the tail at the start and the rim of a surface without a course [m]
    before_rim: float = 0.25
    goal_to_rim: float = 0.2  # distance between the goal and the rim of such a surface [m]
    below: float = 0.3  # distance below the lowest ground at which a module counts as fallen off [m]

    def __post_init__(self) -> None:
        check_not_negative(self, [each.name for each in fields(self)], OptionError)


@dataclass(frozen=True)
class Route:
    """A straight way through an arena; s is measured along it, from the origin of the world."""

    heading: float  # direction of the way, as rotation about z [rad]
    start: float  # s of the center of the head at the start [m]
    lateral: float  # offset of the way to the left of the origin [m]
    finish: float  # s that the center of every module must pass [m]
    half_width: float  # distance to the side of the way beyond which a module has fallen off [m]
    lowest: float  # height below which a module has fallen off [m]
    # s of the near edge, s of the far edge and height of the floor of the pit [m]; None without a pit
    pit: tuple[float, float, float] | None = None
    # z of the ground at the start where something lies above it, as a ceiling or a table [m]; None where the
    # ground is the highest surface everywhere
    start_height: float | None = None

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (x, y)."""
        return float(np.cos(self.heading)), float(np.sin(self.heading))

    def place(self, s: np.ndarray | float, left: np.ndarray | float = 0.0) -> tuple[Any, Any]:
        """Return x and y in the world [m] of positions along the way and to its left [m]."""
        return place_along(self.heading, self.lateral, s, left)


def find_route(
    arena: Arena,
    organism: Organism,
    start: StartName | Point = "floor",
    goal: Point | None = None,
    margins: RouteMargins | None = None,
    pit_search: GapSearch | None = None,
) -> Route:
    """Find the way through an arena from start and goal, or on its surface.

    Without start and goal, the way runs through the middle of the surface along its longer side. Where it meets a
    gap, the start lies before the ramp that leads to it, the finish beyond it, and what is as wide as its ground
    belongs to the way. Where this way is no open ground, as in a room, it is about the longest straight way over
    ground that the organism can drive on. Of an exact arena alone, as the truth is, start, pit and finish are those
    of its course.
    """
    margins = margins or RouteMargins()
    course = arena.course
    if course is not None and isinstance(start, str) and goal is None:
        if isinstance(course, Course):
            return _follow_pit_course(course, arena, organism, start, margins)
        return _follow_stairs(course, arena, organism, start, margins)
    is_before_pit = isinstance(start, str) and start == "pit"
    reason = "a goal is given"
    if isinstance(start, str) and goal is None:
        try:
            gap = find_gap(arena, organism, search=pit_search)
            return _cross_gap(gap, arena, organism, is_before_pit, margins)
        except TaskError as error:
            reason = str(error)
    if is_before_pit:
        raise ArenaError(
            f"arena {arena.name!r} has no known pit to start before ({reason}); use start='floor' or (x, y)"
        )
    route = _follow_surface(arena, organism, start, goal, margins)
    if isinstance(start, str) or goal is not None or route.start_height is not None:
        return route
    return _finish_beyond_gap(route, arena, organism, pit_search)


def _find_lowest(arena: Arena, margins: RouteMargins) -> tuple[float, float]:
    """Return the height of the lowest ground and that below which a module has fallen off [m]."""
    low = float(np.asarray(arena.surface.bounds, dtype=np.float64)[0, 2])
    return low, low - margins.below


def _follow_pit_course(
    course: Course, arena: Arena, organism: Organism, start: StartName, margins: RouteMargins
) -> Route:
    scout = organism.scout
    near, far = course.pit_edges
    floor, lowest = _find_lowest(arena, margins)
    starts = {
        "floor": course.start[0] - margins.before_foot - scout.arm_reach,
        "pit": near - margins.before_pit - scout.arm_reach,
    }
    finish = (far if course.pit > 0.0 else course.goal[0]) + scout.pitch / 2
    return Route(0.0, starts[start], 0.0, finish, course.width / 2, lowest, (near, far, floor))


def _follow_stairs(
    course: StairsCourse, arena: Arena, organism: Organism, start: StartName, margins: RouteMargins
) -> Route:
    if start == "pit":
        raise ArenaError("stairs have no pit to start before; use start='floor'")
    scout = organism.scout
    finish = (course.steps - 1) * course.run + scout.pitch / 2
    lowest = _find_lowest(arena, margins)[1]
    return Route(0.0, -margins.before_foot - scout.arm_reach, 0.0, finish, course.width / 2, lowest)


def _cross_gap(
    gap: Gap, arena: Arena, organism: Organism, is_before_pit: bool, margins: RouteMargins
) -> Route:
    """Return the way across a gap, from before the ramp that leads to it, or from before the gap."""
    way, scout = gap.way, organism.scout
    length = (organism.num_modules - 1) * scout.pitch
    if is_before_pit:
        start = gap.near - margins.before_pit - scout.arm_reach
    elif gap.start > way.begin:
        start = gap.start - margins.before_foot - scout.arm_reach
    else:
        start = way.begin + length + margins.before_rim
    return Route(
        heading=way.heading,
        start=start,
        lateral=way.lateral,
        finish=gap.find_finish(organism),
        half_width=way.half_width,
        lowest=_find_lowest(arena, margins)[1],
        pit=(gap.near, gap.far, gap.floor),
    )


def _finish_beyond_gap(route: Route, arena: Arena, organism: Organism, search: GapSearch | None) -> Route:
    """Return a way from a given start with its finish beyond the first gap on it; the way itself without one."""
    try:
        gap = find_gap(arena, organism, route.direction, search, np.array(route.place(route.start)))
    except TaskError:
        return route
    return replace(route, finish=gap.find_finish(organism), pit=(gap.near, gap.far, gap.floor))


def refuse_start_beyond_gap(
    arena: Arena, organism: Organism, start: Point, search: GapSearch | None = None
) -> None:
    """Refuse a given start beyond the pit of an arena, where crossing it is done already."""
    x, y = np.asarray(start, dtype=np.float64)[:2].tolist()
    if isinstance(arena.course, Course):
        (near, far), heading, reached = arena.course.pit_edges, 0.0, x
        if arena.course.pit == 0.0:
            return
    else:
        try:
            gap = find_gap(arena, organism, search=search)
        except TaskError:
            return
        near, far, heading = gap.near, gap.far, gap.way.heading
        reached = x * np.cos(heading) + y * np.sin(heading)
    if reached > far:
        raise TaskError(
            f"the start ({x:g}, {y:g}) lies beyond the pit of arena {arena.name!r}, whose far edge is {far:.2f} m "
            f"along the heading {np.degrees(heading):.0f}°; start before its near edge, at {near:.2f} m, or give a goal"
        )


def _follow_surface(
    arena: Arena, organism: Organism, start: StartName | Point, goal: Point | None, margins: RouteMargins
) -> Route:
    length = (organism.num_modules - 1) * organism.scout.pitch
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)
    middle, extent = (low[:2] + high[:2]) / 2, (high - low)[:2]
    along = np.array([1.0, 0.0]) if extent[0] >= extent[1] else np.array([0.0, 1.0])
    room = float(extent @ along) / 2
    begin = middle - along * max(room - length - margins.before_rim, 0.0)
    end = middle + along * max(room - margins.goal_to_rim, 0.0)
    given_start = None if isinstance(start, str) else read_place("start", start)
    given_goal = None if goal is None else read_place("goal", goal)
    ends = Ends(begin, end)
    if arena.course is None:
        ends = find_ends(arena, organism, ends, given_start, given_goal)
    else:
        ends = Ends(
            begin if given_start is None else given_start[:2], end if given_goal is None else given_goal[:2]
        )
    begin, end = ends.start, ends.goal
    way = end - begin
    if np.linalg.norm(way) < _SAME_PLACE:
        raise ArenaError(f"start {begin} and goal {end} are the same place; move one of them")
    direction = way / np.linalg.norm(way)
    for name, point in (("start", begin), ("goal", end)):
        if not np.isfinite(arena.height(point[0], point[1])):
            raise ArenaError(f"the {name} {point.tolist()} lies off the surface of arena {arena.name!r}")
    return Route(
        heading=float(np.arctan2(way[1], way[0])),
        start=float(begin @ direction),
        lateral=float(begin @ np.array([-direction[1], direction[0]])),
        finish=float(end @ direction) - length,
        half_width=float(np.linalg.norm(extent)),
        lowest=_find_lowest(arena, margins)[1],
        start_height=ends.start_height,
    )


_EDGE = ScoutConfig.size[2]  # Height of the module to which the defaults belong [m]


@dataclass(frozen=True)
class SuccessCriteria:
    """Limits of a success, and of what ends an episode.

    Wider limits admit what a person would not call a crossing; `symbrion_gym._src.tasks.audit` finds such cases.

    Raises:
        OptionError: a number is out of range.
    """

    # time for which the organism must stay where it should be [s]: one that flies past or tips back does not
    # count
    hold_time: float = 0.3
    upright: float = 0.5  # smallest z component of the up axis of an upright module: leaning by 60 degrees
    # below this z component of its up axis a module has rolled over; below 0, so that one on its side on the
    # way may still right itself
    rolled_over: float = -0.3
    # height of a module's center above the ground that counts as standing on it [m]: half a module's height
    # is 0.0525, one stacked on another is above 0.1
    ground_band: tuple[float, float] = (0.02, 0.075)
    # distance that an organism may be ahead of the path of its tracks, for falling forwards [m]
    speed_slack: float = 0.05
    # how far it may be ahead besides before it arrives, per meter by which the mean height of its modules is
    # below that of the highest: 1 is what pays for sliding at a friction of 1, more than tracks have
    fall_lead: float = 1.0
    # half the edge of the cube in a module that must be beyond the far edge however it is turned [m]
    corner: float = 0.05
    touch_band: float = 0.01  # a module this close to the floor of the pit touches it [m]
    # a coordinate faster than this [m/s or rad/s] means that the simulation has diverged; nothing in an arena
    # is
    max_rate: float = 50.0

    def __post_init__(self) -> None:
        check_not_negative(
            self, ("hold_time", "speed_slack", "fall_lead", "corner", "touch_band"), OptionError
        )
        check_positive(self, ("max_rate",), OptionError)
        for name in ("upright", "rolled_over"):
            if not -1.0 <= getattr(self, name) <= 1.0:
                raise OptionError(f"SuccessCriteria: {name} must lie in [-1, 1], got {getattr(self, name)!r}")
        low, high = self.ground_band
        if not low < high:
            raise OptionError(f"SuccessCriteria: ground_band must be (low, high), got {self.ground_band!r}")

    @classmethod
    def of(cls, scout: ScoutConfig) -> SuccessCriteria:
        """Return the limits for modules of another size: lengths grow with the height of a module."""
        scale = scout.size[2] / _EDGE
        low, high = cls.ground_band
        return cls(
            ground_band=(low * scale, high * scale),
            speed_slack=cls.speed_slack * scale,
            corner=cls.corner * scale,
            touch_band=cls.touch_band * scale,
        )
