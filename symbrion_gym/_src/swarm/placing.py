"""Where a swarm starts before a gap, and who has got across it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.swarm.docks import SCOUT
from symbrion_gym._src.swarm.senses import SwarmWorld
from symbrion_gym._src.swarm.world import SwarmState
from symbrion_gym._src.tasks.route import Route, find_route

SPACING = 0.25  # Distance of two robots at the start [m]: both can turn on the spot with room to spare
_LEAST_SPACING = 0.17
"""Least distance where there is less room [m]: the arm of one that turns just passes that of another, 0.08 m each."""
_SPACING_STEP = 0.005  # By which it is lowered until all find room [m]
RIM = 0.2  # Least distance from the sides of the way, and from its beginning [m]
UPRIGHT = 0.5  # z of the up axis of a robot that is upright, as the task of the snake has it
_MOST_TRIES = 10_000


class Field(NamedTuple):
    """Where a swarm starts and where it is to get."""

    route: Route  # the way across the gap, as found for a snake of 8 Scouts
    low: float  # least s of a start [m]
    high: float  # largest s of a start [m]
    half_width: float  # largest distance of a start from the middle of the way [m]

    @property
    def far_edge(self) -> float:
        """s beyond the gap [m]."""
        return self.route.pit[1] if self.route.pit else self.route.finish

    def find_way(self, position: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Return s of places [m]."""
        return position[:, :2] @ np.array(self.route.direction)


def find_field(arena: Arena, length: int = 8, needs_pit: bool = True) -> Field:
    """Return the ground before the gap of an arena, as the task of a snake finds it on the surface.

    Raises:
        ArenaError: there is no way ahead, or no gap where one is needed.
    """
    body = snake(length)
    route = find_route(arena, body, "floor")
    if route.pit is None and needs_pit:
        raise ArenaError(
            f"arena {arena.name!r} has no pit for a swarm to cross: take 'gsrm' or 'truth', or the task 'assemble'"
        )
    x, y = arena.surface.vertices[:, 0], arena.surface.vertices[:, 1]
    s = x * route.direction[0] + y * route.direction[1]
    begin = max(float(s.min()), route.start - (length - 1) * body.scout.pitch - 0.8)
    return Field(route, begin + RIM, route.start, route.half_width - RIM)


def scatter(
    field: Field, num_robots: int, world: SwarmWorld, rng: np.random.Generator
) -> Float[np.ndarray, "N 3"]:
    """Return x [m], y [m] and heading [rad] of robots before the gap, where they can stand.

    Raises:
        ArenaError: there is no room for so many.
    """
    poses: list[tuple[float, float, float]] = []
    for _ in range(_MOST_TRIES):
        if len(poses) == num_robots:
            return np.array(poses)
        s, left = rng.uniform(field.low, field.high), rng.uniform(-field.half_width, field.half_width)
        heading = rng.uniform(-np.pi, np.pi)
        x, y = (float(value) for value in field.route.place(s, left))
        is_far = all(np.hypot(x - other[0], y - other[1]) > SPACING for other in poses)
        if is_far and world.find_standing(np.array([(x, y, heading)])).all():
            poses.append((x, y, heading))
    return _pack(field, num_robots, world, rng)


def _pack(
    field: Field, num_robots: int, world: SwarmWorld, rng: np.random.Generator
) -> Float[np.ndarray, "N 3"]:
    """Return poses at random places of the widest triangular grid that has enough of them."""
    places = np.zeros((0, 2))
    for spacing in np.arange(SPACING, _LEAST_SPACING, -_SPACING_STEP):
        rows = np.arange(field.low, field.high, spacing * np.sqrt(0.75))
        columns = np.arange(-field.half_width, field.half_width, spacing)
        s, left = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
        left = left + spacing / 2 * np.repeat(np.arange(len(rows)) % 2, len(columns))
        x, y = field.route.place(s, left)
        is_inside = world.find_standing(np.column_stack([x, y, 0 * x])) & (left <= field.half_width)
        places = np.column_stack([x, y])[is_inside]
        if len(places) >= num_robots:
            chosen = rng.choice(len(places), num_robots, replace=False)
            return np.column_stack([places[chosen], rng.uniform(-np.pi, np.pi, num_robots)])
    raise ArenaError(
        f"there is room for {len(places)} robots at the start of the way in {world.arena.name!r}, not for "
        f"{num_robots}; take fewer, or give their poses"
    )


def find_across(state: SwarmState, field: Field) -> Bool[np.ndarray, " N"]:
    """Return which robots are beyond the gap with their whole chassis, upright, undocked and on the ground."""
    is_beyond = field.find_way(state.position) - np.hypot(*SCOUT.size[:2]) / 2 > field.far_edge
    return is_beyond & (state.rotation[:, 2, 2] > UPRIGHT) & ~state.docked.any(axis=1)
