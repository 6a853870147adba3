"""What the body senses: the layout of the observation, its bounds, and how it is read from the physics."""

from __future__ import annotations

from math import pi

import numpy as np

from symbrion_gym.scout import LARGEST_ACCELERATION, LARGEST_TOUCH
from symbrion_gym.world import Physics, World

_LARGEST_RATE = 20.0
_LARGEST_DISTANCE = 100.0
_NOISE = {
    "hinge_angle": 0.005,
    "hinge_rate": 0.05,
    "pitch": 0.01,
    "roll": 0.01,
    "acceleration": 0.3,
    "ir": 0.003,
    "contact": 0.5,
    "odometry": 0.01,
    "laser": 0.006,
}
"""Standard deviation at `noise=1` [unit of the part] (estimates)."""


class Observer:
    """Reads observations of N simulations.

    Attributes:
        structure: name -> slice of the observation.
        size: length of one observation.
        low: `[size]` smallest values.
        high: `[size]` largest values.
        noise: `[size]` standard deviations, scaled by the option `noise`.
    """

    def __init__(self, world: World, num_actions: int) -> None:
        n, h = world.num_modules, world.num_hinges
        limit = world.organism.scout.hinge_range * 1.1
        parts = {
            "hinge_angle": (h, limit),
            "hinge_rate": (h, _LARGEST_RATE),
            "pitch": (n, pi / 2),
            "roll": (n, pi),
            "acceleration": (6 * n, LARGEST_ACCELERATION),
            "contact": (n, LARGEST_TOUCH),
            "previous_action": (num_actions, 1.0),
            "hinge_target": (h, world.organism.scout.hinge_range),
            "odometry": (1, _LARGEST_DISTANCE),
        }
        positive = ("contact", "ir", "laser")
        self.structure: dict[str, slice] = {}
        low, high, noise = [], [], []
        for name in world.config.sensors:
            if name not in parts:
                continue
            size, bound = parts[name]
            start = sum(map(len, high))
            self.structure[name] = slice(start, start + size)
            high.append(np.full(size, bound))
            low.append(np.zeros(size) if name in positive else np.full(size, -bound))
            noise.append(np.full(size, _NOISE.get(name, 0.0)))
        self.low, self.high = np.concatenate(low), np.concatenate(high)
        self.noise = np.concatenate(noise) * world.config.noise
        self.size = len(self.low)
        self._world = world
        self._accelerations = slice(0, 6 * n)
        self._touch = slice(6 * n, 7 * n)
        self._limit = limit

    def read(
        self, physics: Physics, previous_action: np.ndarray, target: np.ndarray, odometry: np.ndarray
    ) -> np.ndarray:
        """Return noiseless observations `[N, size]`, within their bounds."""
        out = np.empty((len(physics.qpos), self.size))
        structure, world = self.structure, self._world
        for name, part in structure.items():
            if name == "hinge_angle":
                out[:, part] = physics.qpos[:, world.hinge_qpos]
            elif name == "hinge_rate":
                out[:, part] = physics.qvel[:, world.hinge_dof]
            elif name == "pitch":
                out[:, part] = np.arcsin(np.clip(physics.rotation[:, :, 6], -1.0, 1.0))
            elif name == "roll":
                out[:, part] = np.arctan2(
                    np.ascontiguousarray(physics.rotation[:, :, 7]),
                    np.ascontiguousarray(physics.rotation[:, :, 8]),
                )
            elif name == "acceleration":
                out[:, part] = physics.sensordata[:, self._accelerations]
            elif name == "contact":
                out[:, part] = physics.sensordata[:, self._touch]
            elif name == "previous_action":
                out[:, part] = previous_action
            elif name == "hinge_target":
                out[:, part] = target
            elif name == "odometry":
                out[:, part] = odometry[:, None]
        np.maximum(out, self.low, out=out)
        return np.minimum(out, self.high, out=out)
