"""Paths over drivable ground, for tasks in which bodies turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.route import Point, Route, RouteMargins
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import (
    DrivingRoute,
    Place,
    find_driving_route,
    find_straight_way,
)

MAX_CORNERS = 64  # Most corners of a path
_CORNER = 0.05  # A path is simplified by no more than this [m]


@dataclass(frozen=True)
class PathRoute(Route):
    """A route with corners, for the middle of a body."""

    # (x, y) of the points to head for, one after the other, the last is the goal [m]
    corners: tuple[tuple[float, float], ...] = ()
    is_place: tuple[bool, ...] = ()  # whether each of them has to be reached exactly, or only shows the way


def find_ground_map(arena: Arena, organism: Organism) -> TraversabilityMap:
    """Return the map of where an organism can drive, module after module along its own track."""
    footprint = Footprint.of(organism, arena.friction)
    return arena.traversability(replace(footprint, radius=footprint.width / 2))


def find_path(
    arena: Arena,
    organism: Organism,
    start: Start,
    places: Sequence[Point],
    distance: float | None = None,
    margins: RouteMargins | None = None,
) -> PathRoute:
    """Find the path from the start over drivable ground through places in turn."""
    if start.place == "pit":
        raise ArenaError("a path does not start before a pit; give start='floor' or (x, y)")
    ground = find_ground_map(arena, organism)
    here: Place | None
    heading: float | None = None
    if not isinstance(start.place, str):
        here = start.place
    elif organism.num_modules > 1:
        here, heading = find_room(ground, organism, arena.name)
    else:
        here = None
    legs: list[DrivingRoute] = []
    friction = arena.find_friction(ground.positions)
    for place in places or (None,):
        leg = find_driving_route(ground, here, place, arena.name, distance, friction=friction)
        legs.append(leg)
        here = leg.goal
    corners, is_place = [], []
    for leg in legs:
        line = simplify(leg.path[:, :2])[1:]
        corners += [(float(x), float(y)) for x, y in line]
        is_place += [False] * (len(line) - 1) + [True]
    if len(corners) > MAX_CORNERS:
        raise ArenaError(
            f"the path has {len(corners)} corners, more than {MAX_CORNERS}; give places that are nearer"
        )
    x, y, z = legs[0].start
    heading = legs[0].heading if heading is None else heading
    c, n = float(np.cos(heading)), float(np.sin(heading))
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)
    lowest = float(low[2]) - (margins or RouteMargins()).below
    highest = float(arena.height(x, y))
    return PathRoute(
        heading=heading,
        start=c * x + n * y,
        lateral=c * y - n * x,
        finish=np.inf,
        half_width=2 * float(np.linalg.norm((high - low)[:2])) + float(np.abs([low[:2], high[:2]]).max()),
        lowest=lowest,
        start_height=z if highest - z > organism.scout.size[2] else None,
        corners=tuple(corners),
        is_place=tuple(is_place),
    )


def find_room(
    ground: TraversabilityMap, organism: Organism, name: str = "arena"
) -> tuple[tuple[float, float, float], float]:
    """Return a place for the head, with room for the whole body behind it on about the longest straight way, and the
    heading of that way [rad].
    """
    way = find_straight_way(ground, ground.region == 0) if ground.num_regions else None
    tail = -min(pose.x for pose in organism.compute_poses()) + organism.scout.size[0]
    length = 0.0 if way is None else float(np.linalg.norm((way[1] - way[0])[:2]))
    if way is None or length < tail:
        raise ArenaError(
            f"arena {name!r} has no straight way of {tail:.2f} m for this body (the longest has {length:.2f} m); give "
            "fewer modules, or a start"
        )
    along = (way[1] - way[0])[:2] / length
    inside = np.flatnonzero(ground.region == 0)
    away = np.linalg.norm(ground.positions[inside, :2] - (way[0][:2] + along * tail), axis=1)
    x, y, z = ground.positions[inside[int(np.argmin(away))]].tolist()
    return (x, y, z), float(np.arctan2(along[1], along[0]))


def simplify(line: Float[np.ndarray, "W 2"]) -> Float[np.ndarray, "C 2"]:
    """Return the corners of a line: no point of it is farther than 5 cm from them (Douglas and Peucker 1973)."""
    if len(line) < 3:
        return line
    ahead = line[-1] - line[0]
    offset = line - line[0]
    share = np.clip(offset @ ahead / max(float(ahead @ ahead), 1e-12), 0.0, 1.0)
    away = np.linalg.norm(offset - share[:, None] * ahead, axis=1)
    worst = int(np.argmax(away))
    if away[worst] <= _CORNER:
        return line[[0, -1]]
    return np.concatenate([simplify(line[: worst + 1])[:-1], simplify(line[worst:])])
