"""Routes of tasks along the ways that were found on a surface."""

from __future__ import annotations

import numpy as np

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.way import Way
from symbrion_gym._src.tasks.route import Route, RouteMargins
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.traversability.routes import read_place

_NOSE = 0.02
"""Room behind the tail at the start of a way, beside half a module [m]."""


def make_route(
    arena: Arena,
    organism: Organism,
    way: Way,
    start: Start,
    foot: float,
    finish: float,
    pit: tuple[float, float, float] | None = None,
    margins: RouteMargins | None = None,
) -> Route:
    """Make the route along a way to what was found on it."""
    margins = margins or RouteMargins()
    reach, place = organism.scout.arm_reach, start.place
    lateral = way.lateral
    if isinstance(place, str):
        if place == "pit" and pit is None:
            raise ArenaError(f"the way in arena {arena.name!r} has no pit; give start='floor' or (x, y)")
        begin = foot - margins.before_foot - reach
        if place == "pit" and pit is not None:
            begin = pit[0] - margins.before_pit - reach
        begin = max(begin, way.begin + _find_tail(organism) + organism.scout.size[0] / 2 + _NOSE)
    else:
        c, n = way.direction
        x, y = read_place("start", place)[:2]
        begin, lateral = c * x + n * y, c * y - n * x
        if begin >= finish:
            raise ArenaError(
                f"the start ({x:.2f}, {y:.2f}) lies beyond the finish in arena {arena.name!r}, which is "
                f"{begin - finish:.2f} m behind it; the way leads to ({c:.2f}, {n:.2f})"
            )
    at = way.place(begin, lateral - way.lateral)
    if not np.isfinite(arena.height(*at)):
        raise ArenaError(f"the start ({at[0]:.2f}, {at[1]:.2f}) lies off the surface of arena {arena.name!r}")
    lowest = float(np.asarray(arena.surface.bounds, dtype=np.float64)[0, 2]) - margins.below
    half_width = way.half_width + abs(lateral - way.lateral)
    return Route(way.heading, float(begin), float(lateral), float(finish), half_width, lowest, pit)


def _find_tail(organism: Organism) -> float:
    """Return how far the organism reaches behind the center of module 0 [m]."""
    return -min(pose.x for pose in organism.find_poses())
