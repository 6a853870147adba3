"""From a world to what its robots sense."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.hearing import HearingConfig, find_geometry, hear, read_wires
from symbrion_gym._src.swarm.behavior.percepts import Percepts, Wired, Words
from symbrion_gym._src.swarm.senses import Senses
from symbrion_gym._src.swarm.signals.infrared import NUM_UNITS
from symbrion_gym._src.swarm.world import DECISION, SwarmState, SwarmWorld

STEEP_BEAMS = {"laser_range": 0.8, "laser_beams": 7, "laser_angles": (-np.pi / 3, -np.pi / 6)}
"""What behaviors need of the forward laser: the beams that meet the ground nearby."""
FARTHEST = 0.30
"""A beam looks for drops if it meets level ground nearer than this to the center of the robot [m]."""


class Sensing:
    """The senses of all robots of a world.

    Args:
        world: where they are.
        config: how well they hear; None for the defaults.
        seed: of all noise.
    """

    def __init__(self, world: SwarmWorld, config: HearingConfig | None = None, seed: int = 0) -> None:
        self._world, self._config = world, config or HearingConfig()
        self._senses = Senses(world, laser=True)
        self.reset(seed)

    def reset(self, seed: int = 0) -> None:
        """Restart all noise and the odometry; call it after a reset of the world."""
        self._rng = np.random.default_rng((seed, 7))
        self._senses.reset(seed)
        self._run = np.zeros((self._world.num_robots, 2))
        self._bias = self._config.bias * self._rng.standard_normal((2, self._world.num_robots))

    def read(self, words: Words, wire: Wired) -> Percepts:
        """Return what the robots sense now."""
        world, rng, config = self._world, self._rng, self._config
        state, readings = world.state, self._senses.read()
        share = np.exp(-DECISION / config.bias_time)
        new = rng.standard_normal((2, world.num_robots))
        self._bias = share * self._bias + config.bias * np.sqrt(1.0 - share**2) * new
        speaks = words.is_beacon | words.is_guide | (words.asker >= 0)
        geometry = find_geometry(state, speaks, config)
        self._run = self._run + readings["odometry"]
        pitch, roll = readings["tilt"].T
        return Percepts(
            proximity=readings["proximity"],
            drop=compute_drop(readings["laser"], pitch, world.scout),
            pitch=pitch,
            roll=roll,
            odometry=self._run,
            docked=find_docked(state),
            beacon=hear(geometry, words, words.is_beacon, config, self._bias, rng),
            guide=hear(geometry, words, words.is_guide, config, self._bias, rng),
            asker=hear(geometry, words, words.asker >= 0, config, self._bias, rng, collides=True),
            wired=read_wires(wire, state.links),
        )


def compute_drop(
    laser: Float[np.ndarray, "N B"], pitch: Float[np.ndarray, " N"], scout: ScoutConfig
) -> Float[np.ndarray, " N"]:
    """Return how far the ground ahead lies below that under a robot [m]; infinity where a beam meets none."""
    origins, directions, ranges = (part[NUM_UNITS:] for part in find_scout_rays(scout))
    ground = -scout.size[2] / 2
    down = np.minimum(directions[:, 2], -np.finfo(float).tiny)
    meets = origins[:, 0] + directions[:, 0] * (ground - origins[:, 2]) / down
    looks = (directions[:, 2] < 0.0) & (meets < FARTHEST)
    hit = origins[looks] + laser[:, looks, None] * directions[looks]
    height = hit[..., 0] * np.sin(pitch)[:, None] + hit[..., 2] * np.cos(pitch)[:, None]
    drop = (ground * np.cos(pitch))[:, None] - height
    drop = np.where(laser[:, looks] < ranges[looks], drop, np.inf)
    return np.maximum(drop.max(axis=-1), 0.0)


def make_scout() -> ScoutConfig:
    """Return the Scouts of a swarm, which read only the steep beams of their lasers, at short range."""
    return ScoutConfig(**STEEP_BEAMS)


def find_docked(state: SwarmState) -> np.ndarray:
    """Return which docks hold another, `[N, 4]`."""
    docked = np.zeros((len(state.position), len(SIDES)), bool)
    for link in state.links:
        for robot, side in link.ends:
            docked[robot, SIDES.index(side)] = True
    return docked
