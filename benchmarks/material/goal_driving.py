"""Drives to the goal of an arena's own route by pure pursuit, from random starts, and what they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from benchmarks.material.pursuit import (
    Drive,
    Driver,
    Pursuit,
    PursuitConfig,
    drive_route,
    make_idle,
    make_random,
)
from benchmarks.material.tracked_robot import TrackedRobot
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism, snake
from symbrion_gym._src.traversability.routes import DrivingRoute

NUM_STARTS = 16
"""Random starts in the region of the goal."""
LEAST_WAY = 0.5
"""Starts are at least this far from the goal [m]: nearer ones say little."""
DRIVERS: dict[str, Callable[[DrivingRoute, PursuitConfig, float], Driver]] = {
    "pursuit": Pursuit,
    "random": lambda route, config, half_length: make_random(config),
    "idle": lambda route, config, half_length: make_idle(config),
}


def drive(
    arena: Arena,
    route: DrivingRoute,
    seeds: Iterable[int],
    body: Organism | None = None,
    driver: str = "pursuit",
    config: PursuitConfig | None = None,
) -> list[Drive]:
    """Drive to the goal of a route from random drivable places of its region, in random directions.

    Args:
        arena: where.
        route: its goal is driven to.
        seeds: one for each drive.
        body: what drives; None for one Scout.
        driver: a name of `DRIVERS`.
        config: how it drives; None for the defaults.
    """
    body, config = body or snake(1), config or PursuitConfig()
    ground, robot = arena.traversability(body), TrackedRobot(arena, body)
    distance = np.linalg.norm(ground.positions - route.goal, axis=1)
    inside = (ground.region == route.region) & (distance > ground.grid.cell)
    far = distance > LEAST_WAY
    candidates = np.flatnonzero(inside & far if (inside & far).any() else inside)
    drives = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        start = ground.positions[rng.choice(candidates)]
        way = arena.find_route(body, start, route.goal)
        steer = DRIVERS[driver](way, config, robot.half_length)
        drives.append(drive_route(robot, ground, way, steer, rng.uniform(-np.pi, np.pi), rng, config))
    return drives


def drive_to_goal(
    arena: Arena, seed: int = 0, num_starts: int = NUM_STARTS, body: Organism | None = None
) -> dict[str, Any]:
    """Return how many of the starts reach the goal, and how many leave the ground; `failed` if there is no route.

    Args:
        arena: where.
        seed: of the starts.
        num_starts: number of drives.
        body: what drives; None for one Scout.
    """
    try:
        route = arena.find_route(body)
    except ArenaError as error:
        return {"route": 0.0, "failed": str(error)}
    drives = drive(arena, route, range(seed * num_starts, (seed + 1) * num_starts), body)
    return {
        "route": 1.0,
        "route_m": route.length,
        "start": route.start,
        "goal": route.goal,
        "starts": num_starts,
        "arrived": sum(each.has_arrived for each in drives),
        "left_ground": sum(each.has_left_ground for each in drives),
        "tipped_over": sum(each.has_tipped_over for each in drives),
        "drives": [
            {
                "start": each.path[0],
                "arrived": each.has_arrived,
                "left": each.has_left_ground,
                "tipped_over": each.has_tipped_over,
                "short": each.remaining,
            }
            for each in drives
        ],
    }
