"""Where an organism starts in an arena, which way it goes, and what arriving means."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import format_extents
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import StairsCourse
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.tasks.features.gap import find_gap
from symbrion_gym._src.tasks.features.way import LIES_UNDER, Line, Way
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import (
    STOREY,
    find_standing_place,
    find_straight_way,
    find_straight_way_from,
    read_place,
)

Point = Sequence[float] | np.ndarray  # (x, y) in the world, or (x, y, z) where there are several storeys [m]
StartName = Literal["floor", "pit"]
START_NAMES = ("floor", "pit")


@dataclass(frozen=True)
class Start:
    """Where a body starts.

    Raises:
        TaskError: no such place.
    """

    # "floor": before the ramp or step, or the beginning of the way; "pit": before the pit; or (x, y) or (x,
    # y, z) of the head [m], where z selects one of several storeys
    place: StartName | Point = "floor"

    def __post_init__(self) -> None:
        if isinstance(self.place, str):
            if self.place not in START_NAMES:
                raise TaskError(f"start must be {' or '.join(START_NAMES)}, or a place, got {self.place!r}")
        else:
            try:
                point = read_place("start", self.place)
            except ArenaError as error:
                raise TaskError(str(error)) from None
            object.__setattr__(self, "place", tuple(point.tolist()))


@dataclass(frozen=True, kw_only=True)
class Route(Line):
    """A straight way through an arena."""

    start: float  # s of the center of the head at the start [m]
    finish: float  # s that the center of every module must pass [m]
    half_width: float  # distance to the side of the way beyond which a module has fallen off [m]
    lowest: float  # height below which a module has fallen off [m]
    # s of the near edge, s of the far edge and height of the floor of the pit [m]; None without a pit
    pit: tuple[float, float, float] | None = None
    # z of the ground at the start where something lies above the way, as a ceiling or a table [m]; None where the
    # ground is the highest surface everywhere
    start_height: float | None = None


@dataclass(frozen=True)
class SuccessCriteria:
    """Limits of a success, and of what ends an episode.

    Wider limits would admit what a person would not call a crossing; `symbrion_gym._src.tasks.audit` finds such cases.
    """

    hold_time: float = 0.3  # time to stay at the goal [s]: one that flies past or tips back does not count
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
    max_rate: float = (
        50.0  # a coordinate that is faster [m/s or rad/s], as nothing in an arena is, has diverged
    )

    @classmethod
    def of(cls, scout: ScoutConfig) -> "SuccessCriteria":
        """Return the limits for modules of another size: lengths grow with the height of a module."""
        scale = scout.size[2] / ScoutConfig.size[2]
        low, high = cls.ground_band
        return cls(
            ground_band=(low * scale, high * scale),
            speed_slack=cls.speed_slack * scale,
            corner=cls.corner * scale,
            touch_band=cls.touch_band * scale,
        )


_BEFORE_FOOT = 0.10  # Between the front of the head at the start and the foot of the ramp or step [m]
_BEFORE_PIT = 0.20  # Between the front of the head and the pit at the start "pit" [m]
_BEFORE_RIM = 0.25  # Between the tail at the start and the rim of a surface without obstacles [m]
_GOAL_TO_RIM = 0.2  # Between the goal and the rim of such a surface [m]
_NOSE = 0.02  # Room behind the tail at the start before an obstacle, beside half a module [m]
_BELOW = 0.3  # A module this far below the lowest ground has fallen off [m]
_SAME_PLACE = 1e-3  # Two points closer than this have no direction from one to the other [m]
_WALL = 0.30
"""What rises by more than this within `_SAMPLES` is a wall [m]: higher than steps and plateaus that snakes climb."""
_SAMPLES = 0.05  # Spacing of heights along a way [m]
_LEAST_WAY = 0.3  # A chosen way has at least this length beside that of the organism [m]
_BEYOND = 0.5  # An organism is laid down on the ground up to this far beyond its ends [m]
_END_ROOM = 0.10
"""Room for the nose and the tail at the ends of a chosen way [m]: a module reaches 0.07 ahead of its center."""


def find_lowest(arena: Arena) -> float:
    """Return the height below which a module has fallen off [m]."""
    return float(np.asarray(arena.surface.bounds, dtype=np.float64)[0, 2]) - _BELOW


def find_tail(organism: Organism) -> float:
    """Return how far the center of the last module is behind that of the head [m]."""
    return -min(pose.x for pose in organism.compute_poses())


def find_ground_map(arena: Arena, organism: Organism) -> TraversabilityMap:
    """Return the map of where an organism can drive, module after module along its own track; each can turn."""
    footprint, (length, width, _) = Footprint.of(organism, arena.friction), organism.scout.size
    radius = max(footprint.width, float(np.hypot(length, width))) / 2
    return arena.traversability(replace(footprint, radius=radius if radius < footprint.reach else None))


def find_route(
    arena: Arena, organism: Organism, start: StartName | Point = "floor", goal: Point | None = None
) -> Route:
    """Find the way through an arena from start and goal, or on its surface.

    Without start and goal, the way runs through the middle of the surface along its longer side. Where it meets a
    gap, the start lies before the ramp that leads to it, the finish beyond it, and what is as wide as its ground
    belongs to the way. Where this way is no open ground, as in a room, it is about the longest straight way over
    ground that the organism can drive on. Of an exact arena alone, as the truth is, start, pit and finish are those
    of its course.
    """
    reason = "a goal is given"
    if isinstance(start, str) and goal is None:
        if arena.course is not None:
            return _follow_course(arena, organism, start)
        try:
            gap = find_gap(arena, organism)
        except TaskError as error:
            reason = str(error)
        else:
            pit = gap.near, gap.far, gap.floor
            return make_route(
                arena, organism, gap.way, Start(start), gap.start, gap.find_finish(organism), pit
            )
    if isinstance(start, str) and start == "pit":
        raise ArenaError(
            f"arena {arena.name!r} has no known pit to start before ({reason}); start on the 'floor' or at (x, y)"
        )
    route = _follow_surface(arena, organism, start, goal)
    if isinstance(start, str) or goal is not None or route.start_height is not None:
        return route
    try:
        gap = find_gap(arena, organism, route.direction, np.array(route.place(route.start)))
    except TaskError:
        return route
    return replace(route, finish=gap.find_finish(organism), pit=(gap.near, gap.far, gap.floor))


def _follow_course(arena: Arena, organism: Organism, start: str) -> Route:
    """Return the way along the sizes of an exact arena."""
    course, scout, pit = arena.course, organism.scout, None
    assert course is not None
    if isinstance(course, StairsCourse):
        if start == "pit":
            raise ArenaError("stairs have no pit to start before; start on the 'floor'")
        begin, end = -_BEFORE_FOOT, (course.steps - 1) * course.run
    else:
        near, far = course.pit_edges
        begin = near - _BEFORE_PIT if start == "pit" else course.start[0] - _BEFORE_FOOT
        end = far if course.pit > 0.0 else course.goal[0]
        pit = near, far, float(arena.surface.bounds[0][2])
    return Route(
        heading=0.0,
        lateral=0.0,
        start=begin - scout.arm_reach,
        finish=end + scout.pitch / 2,
        half_width=course.width / 2,
        lowest=find_lowest(arena),
        pit=pit,
    )


def make_route(
    arena: Arena,
    organism: Organism,
    way: Way,
    start: Start,
    foot: float,
    finish: float,
    pit: tuple[float, float, float] | None = None,
) -> Route:
    """Make the route along a way to what was found on it: its foot, its finish, and its pit, as `Route` has it [m]."""
    place, lateral = start.place, way.lateral
    if isinstance(place, str):
        if place == "pit" and pit is None:
            raise ArenaError(f"the way in arena {arena.name!r} has no pit; start on the 'floor' or at (x, y)")
        begin = foot - _BEFORE_FOOT if place == "floor" or pit is None else pit[0] - _BEFORE_PIT
        room = find_tail(organism) + organism.scout.size[0] / 2 + _NOSE
        begin = max(begin - organism.scout.arm_reach, way.begin + room)
    else:
        c, n = way.direction
        x, y = place[:2]
        begin, lateral = c * x + n * y, c * y - n * x
        if begin >= finish:
            raise ArenaError(
                f"the start ({x:.2f}, {y:.2f}) lies beyond the finish in arena {arena.name!r}, which is "
                f"{begin - finish:.2f} m behind it; the way leads to ({c:.2f}, {n:.2f})"
            )
    route = Route(
        heading=way.heading,
        lateral=float(lateral),
        start=float(begin),
        finish=float(finish),
        half_width=way.half_width + abs(lateral - way.lateral),
        lowest=find_lowest(arena),
        pit=pit,
    )
    x, y = route.place(route.start)
    if not np.isfinite(arena.height(x, y)):
        raise ArenaError(f"the start ({x:.2f}, {y:.2f}) lies off the surface of arena {arena.name!r}")
    return route


def _follow_surface(arena: Arena, organism: Organism, start: StartName | Point, goal: Point | None) -> Route:
    """Return the way between two places on the ground, each given or chosen."""
    length = (organism.num_modules - 1) * organism.scout.pitch
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)
    middle, extent = (low[:2] + high[:2]) / 2, (high - low)[:2]
    along = np.array([1.0, 0.0]) if extent[0] >= extent[1] else np.array([0.0, 1.0])
    room = float(extent @ along) / 2
    first = None if isinstance(start, str) else read_place("start", start)
    last = None if goal is None else read_place("goal", goal)
    begin = middle - along * max(room - length - _BEFORE_RIM, 0.0)
    end = middle + along * max(room - _GOAL_TO_RIM, 0.0)
    height = None
    if arena.course is None:
        begin, end, height = _find_ends(arena, organism, (begin, end), first, last)
    else:
        begin, end = begin if first is None else first[:2], end if last is None else last[:2]
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
        lowest=find_lowest(arena),
        start_height=height,
    )


Ends = tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]]
"""(x, y) of the head at the start and at the goal of a straight way [m]."""


def _find_ends(
    arena: Arena, organism: Organism, middle_way: Ends, start: np.ndarray | None, goal: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Return start and goal on the ground, and the height of the start where something lies above it or the goal.

    The way through the middle is kept where it is open to the sky and no wall stands on it; elsewhere, as in a room,
    about the longest straight way over walkable ground is chosen.
    """
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)[:, :2]
    for name, place in (("start", start), ("goal", goal)):
        if place is not None and ((place[:2] < low).any() or (place[:2] > high).any()):
            raise ArenaError(
                f"the {name} {tuple(place[:2].tolist())} lies outside of arena {arena.name!r}, which extends over "
                f"{format_extents(low.tolist(), high.tolist())}"
            )
    ground = find_ground_map(arena, organism)
    first = None if start is None else find_standing_place(ground, "start", start, arena.name)
    last = None if goal is None else find_standing_place(ground, "goal", goal, arena.name)
    length = (organism.num_modules - 1) * organism.scout.pitch
    if start is None or goal is None:
        is_open = _is_open(arena, ground, middle_way)
        if first is None and last is None:
            if is_open:
                return *middle_way, None
            start, ahead, end = choose_straight_way(
                ground, arena.name, length + _END_ROOM, _LEAST_WAY + _END_ROOM
            )
            goal = end - ahead * _END_ROOM
        elif last is None and first is not None:
            goal = middle_way[1] if is_open else _find_far(ground, first, 0.0)
        elif last is not None:
            start = middle_way[0] if is_open else _find_far(ground, last, length)
    assert start is not None
    assert goal is not None
    first = find_standing_place(ground, "start", start, arena.name)
    begin, end, height = start[:2], goal[:2], float(ground.height[first])
    is_under = _lies_under(arena, begin, end, height, length)
    if last is not None:
        is_under |= float(arena.height(end[0], end[1])) - float(ground.height[last]) > LIES_UNDER
    return begin, end, height if is_under else None


def choose_straight_way(
    ground: TraversabilityMap, name: str, behind: float, ahead: float
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]]:
    """Return a place with room behind and ahead of it [m] on about the longest straight way in the largest region,
    the direction of the way, and its end [m].
    """
    way = find_straight_way(ground, behind + ahead) if ground.num_regions else None
    reach = 0.0 if way is None else float(np.linalg.norm((way[1] - way[0])[:2]))
    if way is None or reach < behind + ahead:
        raise ArenaError(
            f"arena {name!r} has no straight way of {behind + ahead:.2f} m for this body (the longest has {reach:.2f} "
            "m); give fewer modules, or a start and a goal"
        )
    back, end = way[0][:2], way[1][:2]
    direction = (end - back) / reach
    places = ground.positions[ground.region == 0]
    away = np.linalg.norm(places[:, :2] - (back + direction * behind), axis=1)
    return places[int(np.argmin(away))], direction, end


def _is_open(arena: Arena, ground: TraversabilityMap, way: Ends) -> bool:
    """Return whether both ends lie on ground under the open sky and no wall stands between them."""
    count = int(np.ceil(np.linalg.norm(way[1] - way[0]) / _SAMPLES)) + 1
    line = np.linspace(*way, count)
    heights = arena.height(line[:, 0], line[:, 1])
    if not np.isfinite(heights[[0, -1]]).all():
        return False
    near = ground.sorted_heights.find_nearest(ground.grid.compute_cells(line[[0, -1]]), heights[[0, -1]])
    if (near < 0).any() or (np.abs(ground.height[near] - heights[[0, -1]]) > LIES_UNDER).any():
        return False
    return not (np.diff(heights[np.isfinite(heights)]) > _WALL).any()


def _find_far(ground: TraversabilityMap, known: int, length: float) -> Float[np.ndarray, " 2"]:
    """Return a place as far as possible on a straight way from a known one, but for room for a length at its end."""
    is_usable = ground.is_drivable.copy()
    is_usable[known] = True
    far = find_straight_way_from(ground, is_usable, known)[:2]
    way = ground.positions[known, :2] - far
    reach = float(np.linalg.norm(way))
    return far + way * min((length + _END_ROOM) / max(reach, _SAMPLES), 0.5)


def _lies_under(
    arena: Arena, begin: Float[np.ndarray, " 2"], end: Float[np.ndarray, " 2"], height: float, length: float
) -> bool:
    """Return whether something hangs above a straight organism that stands with its head at the start."""
    way = end - begin
    ahead = way / max(float(np.linalg.norm(way)), _SAMPLES)
    line = begin + np.arange(-length - _BEYOND, _BEYOND, _SAMPLES)[:, None] * ahead
    highest = arena.height(line[:, 0], line[:, 1])
    below = arena.elevation.height_below(line[:, 0], line[:, 1], height + STOREY)
    hangs = (highest > height + STOREY) & ~(highest - below <= LIES_UNDER)
    is_below = abs(float(arena.height(begin[0], begin[1])) - height) > LIES_UNDER
    return is_below or bool(hangs.any())
