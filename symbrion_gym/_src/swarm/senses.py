"""A world of robots, and what these sense of the arena and of each other's bodies.

Rays meet the exact surface of the arena, and the chassis of robots.
"""

from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.rows import dot_rows
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.quality import RayMesh
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.robot.scout_constants import ScoutConfig, SensorNoise
from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

_MOST_TESTS = 4_000_000  # Of third robots between two, at once: 16 MB an array
_LEAST = 1e-12  # Components of directions are not smaller than this: no division by zero


class Sight(RayMesh):
    """Casts rays on the surface of an arena and on the chassis of robots, boxes of the size of a Scout."""

    def __init__(self, arena: Arena, scout: ScoutConfig) -> None:
        super().__init__([arena.surface])
        self._half = np.array(scout.size) / 2
        self.robot_radius = float(np.linalg.norm(self._half))  # Of a ball about the chassis [m]

    def cast_on_robots(
        self,
        origins: Float[np.ndarray, "3 N K"],
        directions: Float[np.ndarray, "3 N K"],
        state: SwarmState,
        first: Int[np.ndarray, " P"],
        second: Int[np.ndarray, " P"],
    ) -> Float[np.ndarray, "P K"]:
        """Return how far along each ray of a first robot the chassis of a second one is [m].

        Infinity where it is not on the ray; 0 where the ray begins within it.
        """
        starts = origins.take(first, axis=1) - state.position.take(second, axis=0).T[..., None]
        ways = directions.take(first, axis=1)
        enter, leave = np.zeros(starts.shape[1:]), np.full(starts.shape[1:], np.inf)
        for half, axis in zip(self._half, state.rotation.T.take(second, axis=2)[..., None], strict=True):
            start, way = (x * axis[0] + y * axis[1] + z * axis[2] for x, y, z in (starts, ways))
            way[np.abs(way) < _LEAST] = _LEAST
            middle, around = start / -way, half / np.abs(way)
            np.maximum(enter, middle - around, out=enter)
            np.minimum(leave, middle + around, out=leave)
        return np.where(enter <= leave, enter, np.inf)

    def find_clear(self, state: SwarmState, reach: float) -> Bool[np.ndarray, "N N"]:
        """Return which robots see each other's middle within reach [m].

        Neither surface nor a third robot, a ball of half its width, is between them.
        """
        place = state.position
        between = place - place[:, None]
        squares = dot_rows(between, between)
        first, second = np.nonzero(np.triu(squares < reach**2, k=1))
        step = max(1, _MOST_TESTS // len(place))
        parts = [slice(start, start + step) for start in range(0, max(len(first), 1), step)]
        single = squares.astype(np.float32)  # Faster, and far finer than robots are told apart
        is_shaded = [self._find_shaded(single, first[rows], second[rows]) for rows in parts]
        left = np.flatnonzero(~np.concatenate(is_shaded))
        first, second = first[left], second[left]
        clear = np.zeros(squares.shape, bool)
        clear[first, second] = np.isinf(self.cast(place[first], between[first, second], 1.0))
        return clear | clear.T

    def _find_shaded(
        self, squares: Float[np.ndarray, "N N"], first: Int[np.ndarray, " P"], second: Int[np.ndarray, " P"]
    ) -> Bool[np.ndarray, " P"]:
        """Return between which robots a third one is, from the squares of all distances (law of cosines)."""
        whole, gap = squares[first, second], squares.take(first, axis=1)
        along = gap - squares.take(second, axis=1)
        is_between = np.abs(along) < whole
        along += whole
        along *= along
        along /= 4.0 * np.maximum(whole, _LEAST)
        gap -= along
        is_between &= gap < self._half[1] ** 2
        return is_between.any(axis=0)


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

    def find_standing(self, poses: Float[np.ndarray, "M 3"]) -> Bool[np.ndarray, " M"]:
        """Return at which of any number of poses (x, y, heading) a robot can stand."""
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
    `noise` is a factor on the standard deviations of `SensorNoise`; `beams`, of the lowest ones, how many are read.
    """

    def __init__(
        self, world: SwarmWorld, noise: float = 1.0, seed: int = 0, beams: int | None = None
    ) -> None:
        self._world, self._noise = world, noise
        count = NUM_UNITS + (world.scout.laser_beams if beams is None else beams)
        self._origins, self._directions, self._ranges = (
            rays[:count] for rays in find_scout_rays(world.scout)
        )
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
        frames = state.rotation.transpose(1, 0, 2)
        origins = frames @ self._origins.T + state.position.T[..., None]
        directions = frames @ self._directions.T
        nearest = np.empty((count, num))
        for part, chosen in zip(self._pair(state), (slice(NUM_UNITS), slice(NUM_UNITS, num)), strict=True):
            rays = (ends[..., chosen].reshape(3, -1).T for ends in (origins, directions))
            hits = sight.cast(*rays, reach=self._ranges[chosen].max(initial=0.0))
            nearest[:, chosen] = hits.reshape(count, -1)
            first, second = np.nonzero(part)
            hits = sight.cast_on_robots(origins[..., chosen], directions[..., chosen], state, first, second)
            counts = part.sum(axis=1)
            rows = np.flatnonzero(counts)
            if len(rows):
                begins = np.cumsum(counts[rows]) - counts[rows]
                seen = nearest[rows, chosen]
                nearest[rows, chosen] = np.minimum(seen, np.minimum.reduceat(hits, begins))
        return np.where(nearest <= self._ranges, nearest, np.inf)

    def _pair(self, state: SwarmState) -> tuple[Bool[np.ndarray, "N N"], Bool[np.ndarray, "N N"]]:
        """Return whose rays may hit which robots: infrared those near, the laser those ahead and across its plane."""
        radius = self._world.sight.robot_radius
        way = state.position - state.position[:, None]
        squares = dot_rows(way, way)
        np.fill_diagonal(squares, np.inf)
        ahead, left = (dot_rows(way, state.rotation[:, None, :, axis]) for axis in (0, 1))
        is_near, is_far = (squares < (self._ranges[ray] + 2 * radius) ** 2 for ray in (0, -1))
        return is_near, is_far & (np.abs(left) < radius) & (ahead > 0.0)
