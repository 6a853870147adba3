"""Whether the straight way of a task stays on ground that bodies are known to drive on."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.route import Point, Route, StartName
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.traverse import FarEnd
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import find_straight_way

_NEAR = 0.3
"""Drivable ground up to this far from the start, or beyond the finish, counts as reached [m]: about three modules."""
_END_ROOM = 0.1  # Room for nose and tail at the ends of a way that is proposed [m]
_LEAST_WAY, _MOST_WAY = 0.3, 4.0
"""Smallest and largest length of a way that is proposed [m]; robots drive at 0.1 m/s, so that trials take 40 s."""

Pair = tuple[tuple[float, float], tuple[float, float]]  # (x, y) of a start and of a goal [m]


class BrokenWay(NamedTuple):
    """A way whose start and finish no drivable ground connects."""

    start: tuple[float, float]  # (x, y) of the head [m]
    finish: tuple[float, float]  # (x, y) that every module has to pass [m]
    # start and goal of a straight way that can be driven, inside the largest region; None without one
    other: Pair | None


def find_broken_traverse(
    arena: Arena,
    smallest: Organism,
    largest: Organism,
    start: StartName | Point = "floor",
    goal: Point | None = None,
) -> BrokenWay | None:
    """Return the way of the task "traverse" if it leaves drivable ground for good; None where it does not.

    Ground counts as drivable as in `Arena.traversability`, for a body that need not turn on the spot. Its limits are
    those that bodies are known to climb wherever they meet them: learned ones may climb more, straight on.
    """
    route = FarEnd(goal).find(arena, smallest, Start(start))
    ground = _map_ground(arena, largest)
    begin, finish = (_find_regions(ground, route, s) for s in (route.start, route.finish))
    if np.intersect1d(begin, finish).size:
        return None
    first, last = (route.place(s) for s in (route.start, route.finish))
    return BrokenWay(_round(first), _round(last), find_other(ground, largest))


def propose_way(arena: Arena, body: Organism) -> Pair | None:
    """Return start and goal of a straight way that a body can drive, inside the largest region; None without one."""
    return find_other(_map_ground(arena, body), body)


def _map_ground(arena: Arena, body: Organism) -> TraversabilityMap:
    """Return the ground of a body that need not turn on the spot."""
    footprint = Footprint.of(body, arena.friction)
    return arena.traversability(replace(footprint, radius=footprint.width / 2))


def _find_regions(ground: TraversabilityMap, route: Route, s: float) -> Int[np.ndarray, " N"]:
    """Return the drivable regions on the way near a position along it [m]."""
    drivable = np.flatnonzero(ground.is_drivable)
    c, n = route.direction
    x, y = ground.positions[drivable, :2].T
    along, left = c * x + n * y, c * y - n * x - route.lateral
    is_near = (np.abs(along - s) <= _NEAR) & (np.abs(left) <= max(route.half_width, _NEAR))
    return np.unique(ground.region[drivable[is_near]])


def find_other(ground: TraversabilityMap, body: Organism) -> Pair | None:
    """Return a start with room for a row behind it, and a goal, about as far apart as the largest region allows."""
    way = find_straight_way(ground, ground.region == 0)
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
