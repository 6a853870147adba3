"""A world of robots, and what these sense of the arena and of each other's bodies."""

from typing import Protocol

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.robot.scout_constants import ScoutConfig, SensorNoise
from symbrion_gym._src.swarm.sight import Sight
from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

NUM_UNITS = 8
"""Infrared units of a Scout: two a side, the left one (seen from within) first; sides in the order of `SIDES`."""


class SwarmWorld(Protocol):
    """N robots in an arena at one level of physics."""

    arena: Arena  # where they are
    scout: ScoutConfig  # constants of the robots
    num_robots: int  # N
    time: float  # since the reset [s]
    state: SwarmState  # as it is now; a new object after every step

    @property
    def sight(self) -> Sight:
        """Rays in the arena."""
        ...

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, at x [m], y [m] and heading [rad]."""
        ...

    def step(self, commands: SwarmCommands) -> None:
        """Advance by one decision."""
        ...


class Senses:
    """Reads the sensors of all robots of a world at once.

    | reading | shape | meaning | unit |
    |---|---|---|---|
    | `proximity` | [N, 8] | distance that each infrared unit sees, its range where nothing is near | m |
    | `tilt` | [N, 2] | pitch, positive with the nose up, and roll, positive with the left side up | rad |
    | `odometry` | [N, 2] | way of both tracks since the last reading; slip is not noticed | m |
    | `laser` | [N, B] | distance along the laser's beams, lowest first; its range where nothing is near | m |

    Rays see the exact surface of the arena and the chassis of other robots, boxes of their size, not their arms.
    `noise` is a factor on the standard deviations of `SensorNoise`.
    """

    def __init__(self, world: SwarmWorld, noise: float = 1.0, seed: int = 0) -> None:
        self._world, self._noise = world, noise
        self._origins, self._directions, self._ranges = find_scout_rays(world.scout)
        self.reset(seed)

    def reset(self, seed: int = 0) -> None:
        """Restart the noise and the odometry; call it after a reset of the world."""
        self._rng = np.random.default_rng(seed)
        self._run = np.zeros((self._world.num_robots, 2))

    def read(self) -> dict[str, np.ndarray]:
        """Return the readings now; see the table of the class."""
        state, noise, factor = self._world.state, SensorNoise(), self._noise
        count, ranges = len(state.position), self._ranges
        distance = np.minimum(self._cast(state), ranges)
        spread = np.where(np.arange(len(ranges)) < NUM_UNITS, factor * noise.ir, factor * noise.laser)
        errors = spread * self._rng.standard_normal(distance.shape)
        distance = np.where(distance < ranges, np.clip(distance + errors, 0.0, ranges), ranges)
        tilt = np.arcsin(np.clip(state.rotation[:, 2, :2], -1.0, 1.0))
        way = state.odometry - self._run
        self._run = state.odometry
        slip = factor * noise.track_odometry * self._rng.standard_normal((count, 2))
        leaning = np.array([factor * noise.pitch, factor * noise.roll])
        return {
            "proximity": distance[:, :NUM_UNITS],
            "tilt": tilt + leaning * self._rng.standard_normal((count, 2)),
            "odometry": way * (1.0 + slip),
            "laser": distance[:, NUM_UNITS:],
        }

    def _cast(self, state: SwarmState) -> Float[np.ndarray, "N K"]:
        """Return the exact distance along each ray [m]; inf beyond its range."""
        count, num, sight = len(state.position), len(self._ranges), self._world.sight
        turn = state.rotation.transpose(0, 2, 1)
        origins = self._origins @ turn + state.position[:, None]
        directions = self._directions @ turn
        near, ahead = (part[:, :NUM_UNITS].reshape(-1, 3) for part in (origins, directions))
        rays = np.flatnonzero(sight.may_hit(near, ahead, float(self._ranges[0])))
        short = np.full(len(near), np.inf)
        short[rays] = sight.cast_fans(near[rays], ahead[rays], np.ones(len(rays), np.int64))
        beams = sight.cast_fans(
            origins[:, NUM_UNITS], directions[:, NUM_UNITS:].reshape(-1, 3), np.full(count, num - NUM_UNITS)
        )
        surface = np.concatenate([short.reshape(count, -1), beams.reshape(count, -1)], axis=1)
        flat = origins.reshape(-1, 3), directions.reshape(-1, 3)
        robots = sight.cast_on_robots(*flat, state, *self._pair(state)).reshape(count, num)
        nearest = np.minimum(surface, robots)
        return np.where(nearest <= self._ranges, nearest, np.inf)

    def _pair(self, state: SwarmState) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
        """Return which rays may hit which robots: the infrared of near ones, the laser's plane through farther ones."""
        radius, num = self._world.sight.robot_radius, len(self._ranges)
        way = state.position[None] - state.position[:, None]
        distance = np.linalg.norm(way, axis=2)
        np.fill_diagonal(distance, np.inf)
        ahead = way @ state.rotation
        is_crossed = (np.abs(ahead[..., 1]) < radius) & (ahead[..., 0] > 0.0)
        infrared = distance < self._ranges[0] + 2 * radius
        laser = is_crossed & (distance < self._ranges[-1] + 2 * radius)
        rays, robots = [], []
        for pairs, chosen in ((infrared, np.arange(NUM_UNITS)), (laser, np.arange(NUM_UNITS, num))):
            first, second = np.nonzero(pairs)
            rays.append((first[:, None] * num + chosen).ravel())
            robots.append(np.repeat(second, len(chosen)))
        return np.concatenate(rays), np.concatenate(robots)
