"""Where a body starts in an arena, which way it goes, and where it has arrived."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course, StairsCourse
from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.errors import ArenaError
from symbrion_gym.robot.organism import Organism
from symbrion_gym.tasks.pit_search import find_pit

_MARGIN = 0.10
"""Room before the foot of a ramp or step at the start [m]."""
_PIT_MARGIN = 0.20
"""Room before the pit at the start "pit" [m]."""


@dataclass(frozen=True)
class Route:
    """A straight way through an arena; s is measured along it, from the origin of the world.

    Attributes:
        heading: direction of the way about z [rad].
        start: s of the centre of the head at the start [m].
        lateral: offset of the way to the left of the origin [m].
        finish: s that every module's centre must pass [m].
        half_width: a module farther than this from the way has fallen off the side [m].
        lowest: a module below this has fallen off [m].
        pit: s of the near and far edge and height of the floor of the pit [m], where there is one.
    """

    heading: float
    start: float
    lateral: float
    finish: float
    half_width: float
    lowest: float
    pit: tuple[float, float, float] | None = None

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (x, y)."""
        return float(np.cos(self.heading)), float(np.sin(self.heading))

    def place(self, s: np.ndarray | float, left: np.ndarray | float = 0.0) -> tuple[Any, Any]:
        """Return x and y in the world [m] of places along the way and to its left [m]."""
        c, n = self.direction
        across = self.lateral + left
        return c * s - n * across, n * s + c * across


def find_route(arena: Arena, organism: Organism, config: SnakePitConfig) -> Route:
    """Find the way through an arena from the course behind it or from the options `start` and `goal`.

    Without either, the way runs through the middle of the surface along its longer side; where it meets a
    pit, the finish lies beyond that.

    Raises:
        ArenaError: the start lies off the surface, or the arena has no pit although the start is "pit".
    """
    scout = organism.scout
    length = (organism.num_modules - 1) * scout.pitch
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)
    lowest = float(low[2]) - 0.3
    course = arena.course
    if course is not None and isinstance(config.start, str) and config.goal is None:
        half = scout.pitch / 2
        if isinstance(course, Course):
            near, far = course.pit_edges
            starts = {
                "floor": course.start[0] - _MARGIN - scout.arm_reach,
                "pit": near - _PIT_MARGIN - scout.arm_reach,
            }
            finish = far + half if course.pit > 0.0 else course.goal[0] + half
            return Route(
                0.0,
                starts[config.start],
                0.0,
                finish,
                course.width / 2,
                lowest,
                (near, far, float(low[2])),
            )
        return _follow_stairs(course, config, scout.arm_reach, half, lowest)
    route = _follow_surface(arena, config, length, low, high, lowest)
    pit = _find_pit_on(route, arena, length) if config.goal is None else None
    if pit is not None:
        start = pit[0] - _PIT_MARGIN - scout.arm_reach if config.start == "pit" else route.start
        return replace(route, start=start, finish=pit[1] + scout.pitch / 2, pit=pit)
    if config.start == "pit":
        raise ArenaError(
            f"arena {arena.name!r} has no known pit to start before; use start='floor' or (x, y)"
        )
    return route


def _find_pit_on(route: Route, arena: Arena, length: float) -> tuple[float, float, float] | None:
    """Return s of the edges of the first pit on a way across a surface, and the height of its floor."""
    start = np.array(route.place(route.start))
    found = find_pit(arena, start, np.array(route.direction), route.finish + length - route.start)
    return None if found is None else (route.start + found[0], route.start + found[1], found[2])


def _follow_stairs(
    course: StairsCourse, config: SnakePitConfig, reach: float, half: float, lowest: float
) -> Route:
    if config.start == "pit":
        raise ArenaError("stairs have no pit to start before; use start='floor'")
    finish = (course.steps - 1) * course.run + half
    return Route(0.0, -_MARGIN - reach, 0.0, finish, course.width / 2, lowest)


def _follow_surface(
    arena: Arena, config: SnakePitConfig, length: float, low: np.ndarray, high: np.ndarray, lowest: float
) -> Route:
    middle, extent = (low[:2] + high[:2]) / 2, (high - low)[:2]
    along = np.array([1.0, 0.0]) if extent[0] >= extent[1] else np.array([0.0, 1.0])
    room = float(extent @ along) / 2
    start = _read_point("start", config.start) if not isinstance(config.start, str) else None
    if start is None:
        start = middle - along * max(room - length - 0.25, 0.0)
    goal = (
        _read_point("goal", config.goal) if config.goal is not None else middle + along * max(room - 0.2, 0.0)
    )
    way = goal - start
    if np.linalg.norm(way) < 1e-3:
        raise ArenaError(f"start {start} and goal {goal} are the same place; move one of them")
    heading = float(np.arctan2(way[1], way[0]))
    direction = way / np.linalg.norm(way)
    normal = np.array([-direction[1], direction[0]])
    for name, point in (("start", start), ("goal", goal)):
        if not np.isfinite(arena.height(point[0], point[1])):
            raise ArenaError(f"the {name} {point.tolist()} lies off the surface of arena {arena.name!r}")
    return Route(
        heading,
        float(start @ direction),
        float(start @ normal),
        float(goal @ direction) - length,
        float(np.linalg.norm(extent)),
        lowest,
    )


def _read_point(name: str, value: Any) -> np.ndarray:
    point = np.asarray(value, dtype=np.float64).ravel()[:2]
    if point.shape != (2,) or not np.isfinite(point).all():
        raise ArenaError(f"{name} must be a place (x, y) in metres, got {value!r}")
    return point
