"""Lone robots put on the ground of an arena."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.tasks.route import Route, find_route

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.world import SwarmState

LIFT = 0.002
"""Gap between the tracks and the ground at the start [m]: without one, contacts would begin with a push."""
STEEPEST = np.deg2rad(35.0)
"""Robots are placed on no steeper ground [rad]: a track of friction 0.7 slips there."""
_SAMPLES = 5  # Heights are read at this many places along each side of a footprint


def lay_robots(
    arena: Arena, poses: Float[np.ndarray, "N 3"], scout: ScoutConfig
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3 3"]]:
    """Return positions [m] and rotations of robots that stand on the ground.

    A robot stands on the plane that fits the ground below it best, lifted so that it clears all of it.
    """
    poses = np.asarray(poses, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ArenaError(f"poses of shape {poses.shape}; rows of finite x, y and heading are needed")
    side = np.linspace(-0.5, 0.5, _SAMPLES)
    local = np.stack(np.meshgrid(side * scout.size[0], side * scout.size[1], indexing="ij"), axis=-1)
    local = local.reshape(-1, 2)
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turn = np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], axis=-2)
    spots = np.einsum("nij,sj->nsi", turn, local)
    world = spots + poses[:, None, :2]
    heights = np.asarray(arena.height(*world.reshape(-1, 2).T), dtype=np.float64).reshape(world.shape[:2])
    for robot in np.flatnonzero(~np.isfinite(heights).all(axis=1)):
        x, y = poses[robot, :2]
        raise ArenaError(f"robot {robot} at ({x:.2f}, {y:.2f}) lies off the surface of arena {arena.name!r}")
    _check_apart(poses, scout)
    slope = np.stack([_fit_plane(one, high) for one, high in zip(spots, heights, strict=True)])
    normal = np.column_stack([-slope, np.ones(len(slope))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    _check_steepness(normal, arena)
    ahead = np.column_stack([cosine, sine, np.zeros(len(poses))])
    ahead -= np.einsum("ni,ni->n", ahead, normal)[:, None] * normal
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    rotation = np.stack([ahead, np.cross(normal, ahead), normal], axis=-1)
    offset = np.einsum("nsi,ni->ns", spots, normal[:, :2]) + heights * normal[:, 2:]
    lift = offset.max(axis=1) + scout.size[2] / 2 + LIFT
    foot = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    return foot + np.column_stack([np.zeros((len(poses), 2)), lift / normal[:, 2]]), rotation


def _fit_plane(spots: Float[np.ndarray, "S 2"], heights: Float[np.ndarray, " S"]) -> Float[np.ndarray, " 2"]:
    return np.linalg.lstsq(np.column_stack([spots, np.ones(len(spots))]), heights, rcond=None)[0][:2]


def _check_apart(poses: Float[np.ndarray, "N 3"], scout: ScoutConfig) -> None:
    """Refuse robots that overlap: rectangles from the back of the chassis to the tip of the level arm."""
    ahead = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    middles = poses[:, :2] + (scout.arm_reach - scout.size[0] / 2) / 2 * ahead
    half = np.array([scout.arm_reach + scout.size[0] / 2, scout.size[1]]) / 2
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=-1)
    for first, second in np.argwhere(np.triu(apart < 2 * np.hypot(*half), k=1)):
        axes = [np.array([[x, y], [-y, x]]) for x, y in ahead[[first, second]]]
        if not _is_separated(middles[second] - middles[first], axes, half):
            raise ArenaError(
                f"robots {first} and {second} at {apart[first, second]:.3f} m overlap; place them farther apart"
            )


def _is_separated(
    between: Float[np.ndarray, " 2"], axes: list[Float[np.ndarray, "2 2"]], half: Float[np.ndarray, " 2"]
) -> bool:
    """Return whether a side of one of two equal rectangles separates them."""
    for own in axes:
        reach = sum(np.abs(own @ other.T) @ half for other in axes)
        if (np.abs(own @ between) >= reach).any():
            return True
    return False


def _check_steepness(normal: Float[np.ndarray, "N 3"], arena: Arena) -> None:
    steep = np.arccos(np.clip(normal[:, 2], -1.0, 1.0))
    for robot in np.flatnonzero(steep > STEEPEST):
        raise ArenaError(
            f"the ground of {arena.name!r} below robot {robot} is {np.rad2deg(steep[robot]):.0f} degrees steep; "
            f"{np.rad2deg(STEEPEST):.0f} are possible"
        )


SPACING = 0.25  # Least distance of two robots at the start [m]: both can turn on the spot
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


def find_field(arena: Arena, length: int = 8) -> Field:
    """Return the ground before the gap of an arena, as the task of a snake finds it on the surface."""
    body = snake(length)
    route = find_route(arena, body, "floor")
    if route.pit is None:
        raise ArenaError(
            f"arena {arena.name!r} has no pit; a swarm needs one to cross: take 'gsrm' or 'truth'"
        )
    x, y = arena.surface.vertices[:, 0], arena.surface.vertices[:, 1]
    s = x * route.direction[0] + y * route.direction[1]
    begin = max(float(s.min()), route.start - (length - 1) * body.scout.pitch - 0.8)
    return Field(route, begin + RIM, route.start, route.half_width - RIM)


def scatter(
    field: Field, num_robots: int, arena: Arena, rng: np.random.Generator
) -> Float[np.ndarray, "N 3"]:
    """Return x [m], y [m] and heading [rad] of robots on the ground before the gap, on level ground."""
    poses: list[tuple[float, float, float]] = []
    for _ in range(_MOST_TRIES):
        if len(poses) == num_robots:
            return np.array(poses)
        s, left = rng.uniform(field.low, field.high), rng.uniform(-field.half_width, field.half_width)
        heading = rng.uniform(-np.pi, np.pi)
        x, y = (float(value) for value in field.route.place(s, left))
        is_far = all(np.hypot(x - other[0], y - other[1]) > SPACING for other in poses)
        if is_far and np.isfinite(np.asarray(arena.height(x, y))).all():
            poses.append((x, y, heading))
    raise ArenaError(
        f"there is room for {len(poses)} robots {SPACING} m apart before the pit of {arena.name!r}, not for "
        f"{num_robots}; take fewer"
    )


def find_across(state: SwarmState, field: Field, scout: ScoutConfig) -> Bool[np.ndarray, " N"]:
    """Return which robots are beyond the gap with their whole chassis, upright, undocked and on the ground."""
    joined = np.zeros(len(state.position), bool)
    for link in state.links:
        joined[[link.first, link.second]] = True
    is_beyond = field.find_way(state.position) - np.hypot(*scout.size[:2]) / 2 > field.far_edge
    is_up = state.rotation[:, 2, 2] > UPRIGHT
    return is_beyond & is_up & ~joined
