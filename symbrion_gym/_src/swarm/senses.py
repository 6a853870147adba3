"""What the robots of a swarm sense of the arena and of each other's bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.robot.scout_constants import SensorNoise
from symbrion_gym._src.swarm.docks import make_organism
from symbrion_gym._src.swarm.dynamic.assembly import compute_contact_forces
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.sight import Sight
from symbrion_gym._src.swarm.signals.infrared import NUM_UNITS

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym._src.swarm.world import SwarmState, SwarmWorld


class Senses:
    """Reads the sensors of all robots of a world at once.

    | reading | shape | meaning | unit |
    |---|---|---|---|
    | `proximity` | [N, 8] | distance that each infrared unit sees, its range where nothing is near; two a side, the left one (seen from within) first, sides in the order of `SIDES` | m |
    | `tilt` | [N, 2] | pitch, positive with the nose up, and roll, positive with the left side up | rad |
    | `odometry` | [N, 2] | way of the left and right track since the last reading; slip is not noticed | m |
    | `laser` | [N, B] | distance along each beam of the forward laser, from the lowest to the highest; its range where nothing is near | m |

    Rays see the exact surface of the arena and the chassis of other robots, boxes of their size, not their arms.

    Args:
        world: whose state is read.
        laser: whether the laser is read as well.
        noise: standard deviations; None for the defaults, estimates.
        seed: of the noise.
        sight: rays in the arena; None for those of the world if it has some, else new ones.
    """  # noqa: E501

    def __init__(
        self,
        world: SwarmWorld,
        laser: bool = False,
        noise: SensorNoise | None = None,
        seed: int = 0,
        sight: Sight | None = None,
    ) -> None:
        self._world, self._noise = world, noise or SensorNoise()
        self.sight = sight or getattr(world, "sight", None) or Sight(world.arena, world.scout)
        rays = find_scout_rays(world.scout)
        self._origins, self._directions, self._ranges = rays
        self._num_rays = len(self._ranges) if laser else NUM_UNITS
        self.reset(seed)

    def reset(self, seed: int = 0) -> None:
        """Restart the noise and the odometry; call it after a reset of the world."""
        self._rng = np.random.default_rng(seed)
        self._run = np.zeros((self._world.num_robots, 2))

    def read(self) -> dict[str, np.ndarray]:
        """Return the readings now; see the table of the class."""
        state, noise = self._world.state, self._noise
        count = len(state.position)
        ranges = self._ranges[: self._num_rays]
        distance = np.minimum(self._cast(state), ranges)
        spread = np.where(np.arange(self._num_rays) < NUM_UNITS, noise.ir, noise.laser)
        errors = spread * self._rng.standard_normal(distance.shape)
        distance = np.where(distance < ranges, np.clip(distance + errors, 0.0, ranges), ranges)
        tilt = np.arcsin(np.clip(state.rotation[:, 2, :2], -1.0, 1.0))
        way = state.odometry - self._run
        self._run = state.odometry
        relative = noise.track_odometry * self._rng.standard_normal((count, 2))
        readings = {
            "proximity": distance[:, :NUM_UNITS],
            "tilt": tilt + [noise.pitch, noise.roll] * self._rng.standard_normal((count, 2)),
            "odometry": way * (1.0 + relative),
        }
        if self._num_rays > NUM_UNITS:
            readings["laser"] = distance[:, NUM_UNITS:]
        return readings

    def _cast(self, state: SwarmState) -> Float[np.ndarray, "N K"]:
        """Return the exact distance along each ray [m]; inf beyond its range."""
        count, num = len(state.position), self._num_rays
        turn = state.rotation.transpose(0, 2, 1)
        origins = self._origins[:num] @ turn + state.position[:, None]
        directions = self._directions[:num] @ turn
        ranges = np.tile(self._ranges[:num], count)
        near = origins[:, :NUM_UNITS].reshape(-1, 3), directions[:, :NUM_UNITS].reshape(-1, 3)
        surface = np.empty((count, num))
        surface[:, :NUM_UNITS] = self.sight.cast_short(
            *near, np.tile(self._ranges[:NUM_UNITS], count)
        ).reshape(count, -1)
        if num > NUM_UNITS:
            fans = np.full(count, num - NUM_UNITS)
            beams = self.sight.cast_fans(
                origins[:, NUM_UNITS], directions[:, NUM_UNITS:].reshape(-1, 3), fans
            )
            surface[:, NUM_UNITS:] = beams.reshape(count, -1)
        flat = origins.reshape(-1, 3), directions.reshape(-1, 3)
        nearest = np.minimum(surface.ravel(), self.sight.cast_on_robots(*flat, state, *self._pair(state)))
        return np.where(nearest <= ranges, nearest, np.inf).reshape(count, num)

    def _pair(self, state: SwarmState) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
        """Return which rays may hit which robots: the infrared of near ones, the laser's plane through farther ones."""
        radius = self.sight.robot_radius
        way = state.position[None] - state.position[:, None]
        distance = np.linalg.norm(way, axis=2)
        np.fill_diagonal(distance, np.inf)
        first, second = np.nonzero(distance < self._ranges[0] + 2 * radius)
        rays = [first[:, None] * self._num_rays + np.arange(NUM_UNITS)]
        robots = [np.repeat(second[:, None], NUM_UNITS, axis=1)]
        if self._num_rays > NUM_UNITS:
            ahead = way @ state.rotation
            crossed = (np.abs(ahead[..., 1]) < radius) & (ahead[..., 0] > 0.0)
            first, second = np.nonzero(crossed & (distance < self._ranges[-1] + 2 * radius))
            rays.append(first[:, None] * self._num_rays + np.arange(NUM_UNITS, self._num_rays))
            robots.append(np.repeat(second[:, None], self._num_rays - NUM_UNITS, axis=1))
        return np.concatenate([each.ravel() for each in rays]), np.concatenate(
            [each.ravel() for each in robots]
        )


def find_modules(world: SwarmWorld, robots: Sequence[int], root: int | None = None) -> tuple[int, ...]:
    """Return docked robots in the order of the modules of their organism; see `make_organism`."""
    links = [link for link in world.state.links if link.first in robots]
    return make_organism(links, robots, world.scout, root)[1]


def is_organism(world: DynamicWorld, modules: Sequence[int]) -> bool:
    """Return whether robots are the very tree of an `Organism`: all docks have mated and free arms are folded."""
    trees = world.assembly.layout.trees
    return any(tree.is_organism and set(tree.robots) == set(modules) for tree in trees)


def read_organism(world: DynamicWorld, modules: Sequence[int]) -> dict[str, np.ndarray]:
    """Return parts of the observation of an organism, without noise, as its environment has them."""
    modules = list(modules)
    if not is_organism(world, modules):
        trees = [each.robots for each in world.assembly.layout.trees if each.is_organism]
        raise OptionError(
            f"robots {modules} are not one organism yet; there are {trees}: step until they have mated and folded arms"
        )
    hinged = [robot for robot in modules if world.assembly.hinge_qpos[robot] >= 0]
    rotation = world.state.rotation[modules]
    return {
        "hinge_angle": world.state.hinge[hinged],
        "pitch": np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0)),
        "roll": np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
        "contact": np.minimum(_compute_touches(world)[modules], world.scout.contact_range),
    }


def _compute_touches(world: DynamicWorld) -> Float[np.ndarray, " N"]:
    """Return the sum of the normal forces on each robot [N]."""
    touches = np.zeros(world.num_robots)
    owners, forces = compute_contact_forces(world.assembly, world.data)
    for side in range(2):
        is_robot = owners[:, side] >= 0
        np.add.at(touches, owners[is_robot, side], forces[is_robot, 0])
    return touches
