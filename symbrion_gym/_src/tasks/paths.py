"""Ways over drivable ground: paths with corners for bodies that turn, and straight ways that leave it for good."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.route import (
    Point,
    Route,
    Start,
    choose_straight_way,
    find_ground_map,
    find_lowest,
    find_tail,
)
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import (
    DrivingRoute,
    Place,
    find_driving_route,
    find_nearest_level,
    find_straight_way,
)

MAX_CORNERS = 64  # Most corners of a path
_CORNER = 0.05  # A path is simplified by no more than this [m]


@dataclass(frozen=True, kw_only=True)
class PathRoute(Route):
    """A route with corners, for the middle of a body."""

    # (x, y) of the points to head for, one after the other, the last is the goal [m]
    corners: tuple[tuple[float, float], ...] = ()
    is_place: tuple[bool, ...] = ()  # whether each of them has to be reached exactly, or only shows the way
    # from the way between each and the next to what the body's reach has to keep off [m]
    room: tuple[float, ...] = ()
    places: tuple[tuple[float, float, float], ...] = ()  # (x, y, z) of those that have to be reached [m]


def find_path(
    arena: Arena, organism: Organism, start: Start, places: Sequence[Point], distance: float | None = None
) -> PathRoute:
    """Find the path from the start over drivable ground through places in turn; without any, to one that is chosen, at
    most a distance away [m]."""
    if start.place == "pit":
        raise ArenaError("a path does not start before a pit; start on the 'floor' or at (x, y)")
    ground = find_ground_map(arena, organism)
    here: Place | None = None if isinstance(start.place, str) else start.place
    heading: float | None = None
    if here is None and organism.num_modules > 1:
        here, ahead, _ = choose_straight_way(
            ground, arena.name, find_tail(organism) + organism.scout.size[0], 0.0
        )
        heading = float(np.arctan2(ahead[1], ahead[0]))
    legs: list[DrivingRoute] = []
    friction = arena.find_friction(ground.positions)
    for place in places or (None,):
        leg = find_driving_route(ground, here, place, arena.name, distance, friction=friction)
        legs.append(leg)
        here = leg.goal
    corners, is_place, room = [], [], []
    for leg in legs:
        turns = _simplify(leg.path)[1:]
        corners += [(float(x), float(y)) for x, y, _ in leg.path[turns]]
        is_place += [False] * (len(turns) - 1) + [True]
        around = ground.wall_distance[find_nearest_level(ground, leg.path[:, :2], leg.path[:, 2])]
        least = np.minimum(np.minimum.reduceat(around, turns), around[[*turns[1:], -1]])
        room += (least - ground.footprint.reach).tolist()
    if len(corners) > MAX_CORNERS:
        raise ArenaError(
            f"the path has {len(corners)} corners, more than {MAX_CORNERS}; give places that are nearer"
        )
    x, y, z = legs[0].start
    is_beside = np.linalg.norm(ground.positions[:, :2] - (x, y), axis=1) < 2 * ground.footprint.length
    way = np.concatenate([ground.positions[is_beside], *[leg.path for leg in legs]])
    lies_under = (arena.height(way[:, 0], way[:, 1]) - way[:, 2] > organism.scout.size[2]).any()
    heading = legs[0].heading if heading is None else heading
    c, n = float(np.cos(heading)), float(np.sin(heading))
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)
    return PathRoute(
        heading=heading,
        start=c * x + n * y,
        lateral=c * y - n * x,
        finish=np.inf,
        half_width=2 * float(np.linalg.norm((high - low)[:2])) + float(np.abs([low[:2], high[:2]]).max()),
        lowest=find_lowest(arena),
        start_height=z if lies_under else None,
        corners=tuple(corners),
        is_place=tuple(is_place),
        room=tuple(room),
        places=tuple(leg.goal for leg in legs),
    )


def _simplify(line: Float[np.ndarray, "W 3"], first: int = 0) -> list[int]:
    """Return the numbers of the corners of a line, with both ends: in plan none of its points is over 5 cm from the
    lines between them (Douglas and Peucker 1973)."""
    ends = [first, first + len(line) - 1]
    if len(line) < 3:
        return ends
    ahead, offset = (line[-1] - line[0])[:2], (line - line[0])[:, :2]
    share = np.clip(offset @ ahead / max(float(ahead @ ahead), 1e-12), 0.0, 1.0)
    away = np.linalg.norm(offset - share[:, None] * ahead, axis=1)
    worst = int(np.argmax(away))
    if away[worst] <= _CORNER:
        return ends
    return _simplify(line[: worst + 1], first)[:-1] + _simplify(line[worst:], first + worst)


_END_ROOM = 0.1  # Room for nose and tail at the ends of a way that is proposed [m]
_LEAST_WAY, _MOST_WAY = 0.3, 4.0
"""Smallest and largest length of a way that is proposed [m]; robots drive at 0.1 m/s, so that trials take 40 s."""

Pair = tuple[tuple[float, float], tuple[float, float]]  # (x, y) of a start and of a goal [m]


def propose_way(arena: Arena, body: Organism) -> Pair | None:
    """Return start and goal of a straight way that a body can drive, about as far apart as the largest region allows,
    with room for a row behind the start; None without one."""
    ground = find_ground_map(arena, body)
    way = find_straight_way(ground)
    if way is None:
        return None
    back, end = way[0][:2], way[1][:2]
    reach = float(np.linalg.norm(end - back))
    tail = min(Footprint.of(body).length + _END_ROOM, reach / 2)
    if reach - tail - _END_ROOM < _LEAST_WAY:
        return None
    ahead = (end - back) / reach
    return _round(back + tail * ahead), _round(back + min(reach - _END_ROOM, tail + _MOST_WAY) * ahead)


def _round(place: tuple[float, float] | Float[np.ndarray, " 2"]) -> tuple[float, float]:
    x, y = (round(float(value), 2) + 0.0 for value in place)
    return x, y
