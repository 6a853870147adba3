"""From a world to what its robots sense."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from symbrion_gym.robot.scout_constants import SIDES
from symbrion_gym.swarm.behavior.hearing import HearingConfig, find_geometry, hear, read_wires
from symbrion_gym.swarm.behavior.percepts import Percepts, Wired, Words
from symbrion_gym.swarm.behavior.steering import SIDE_ANGLES, wrap
from symbrion_gym.swarm.world import SwarmState, SwarmWorld

_LOOK_AHEAD = 0.16
"""The ground is looked at so far ahead of the center of a robot [m]: less than its laser sees of it."""
_TILT_NOISE, _RANGE_NOISE = 0.01, 0.003
"""Standard deviations of tilt [rad] and infrared range [m] (E, as `SensorNoise`)."""


class Sensing:
    """The senses of all robots of a world.

    Args:
        world: where they are.
        config: how well they hear; None for the defaults.
        seed: of all noise.
    """

    def __init__(self, world: SwarmWorld, config: HearingConfig | None = None, seed: int = 0) -> None:
        self._world, self._config = world, config or HearingConfig()
        self._rng = np.random.default_rng((seed, 7))

    def read(self, words: Words, wire: Wired) -> Percepts:
        """Return what the robots sense now.

        Args:
            words: what docks broadcast.
            wire: what robots say over their wires.
        """
        world, rng, config = self._world, self._rng, self._config
        state, count = world.state, world.num_robots
        geometry = find_geometry(state, config)
        tilt = _TILT_NOISE * rng.standard_normal((2, count))
        docked = find_docked(state)
        return Percepts(
            proximity=find_proximity(state, world.scout.ir_range)
            + _RANGE_NOISE * rng.standard_normal((count, 2 * len(SIDES))),
            drop=self._find_drop(state),
            pitch=np.arcsin(np.clip(state.rotation[:, 2, 0], -1.0, 1.0)) + tilt[0],
            roll=np.arcsin(np.clip(state.rotation[:, 2, 1], -1.0, 1.0)) + tilt[1],
            odometry=state.odometry,
            docked=docked,
            beacon=hear(geometry, words, words.is_beacon, config, rng),
            guide=hear(geometry, words, words.is_guide, config, rng),
            asker=hear(geometry, words, words.asker >= 0, config, rng, collides=True),
            wired=read_wires(wire, state.links),
        )

    def _find_drop(self, state: SwarmState) -> Float[np.ndarray, " N"]:
        """Return how far the ground ahead lies below the robot's own; infinity where there is none."""
        heading = np.arctan2(state.rotation[:, 1, 0], state.rotation[:, 0, 0])
        x, y = state.position[:, 0], state.position[:, 1]
        ahead = self._world.arena.height(x + _LOOK_AHEAD * np.cos(heading), y + _LOOK_AHEAD * np.sin(heading))
        ahead = np.asarray(ahead, dtype=np.float64)
        here = state.position[:, 2] - self._world.scout.size[2] / 2
        return np.where(np.isfinite(ahead), np.maximum(here - ahead, 0.0), np.inf)


def find_docked(state: SwarmState) -> np.ndarray:
    """Return which docks hold another, `[N, 4]`."""
    docked = np.zeros((len(state.position), len(SIDES)), bool)
    for link in state.links:
        for robot, side in link.ends:
            docked[robot, SIDES.index(side)] = True
    return docked


def find_proximity(state: SwarmState, reach: float) -> Float[np.ndarray, "N 8"]:
    """Return distances to other robots, as discs, on each side [m]."""
    count = len(state.position)
    way = state.position[None, :, :2] - state.position[:, None, :2]
    heading = np.arctan2(state.rotation[:, 1, 0], state.rotation[:, 0, 0])
    bearing = wrap(np.arctan2(way[..., 1], way[..., 0]) - heading[:, None])
    gap = np.maximum(np.hypot(way[..., 0], way[..., 1]) - 0.105, 0.0)
    gap[np.arange(count), np.arange(count)] = reach
    side = np.abs(wrap(bearing[..., None] - SIDE_ANGLES)).argmin(axis=-1)
    near = np.full((count, len(SIDES)), reach)
    for k in range(len(SIDES)):
        near[:, k] = np.minimum(reach, np.where(side == k, gap, reach).min(axis=-1))
    return np.repeat(near, 2, axis=-1)
