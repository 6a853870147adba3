"""What the body senses: the layout of the observation, its bounds, and how it is read from the physics."""

from __future__ import annotations

from math import isnan, pi

import numpy as np

from symbrion_gym.environment.world import Physics, World, make_slice
from symbrion_gym.robot.scout_sensors import (
    LARGEST_ACCELERATION,
    LARGEST_TOUCH,
    MEASURED,
    NUM_LASER_BEAMS,
    find_free_sides,
)

_LARGEST_RATE = 20.0
_LARGEST_DISTANCE = 100.0
_TOLD = ("previous_action", "hinge_target", "odometry")
"""Parts that the physics does not know."""
_NOTHING_HIT = 1.0
"""A ray that hits nothing reads -1, which as a distance is beyond a shorter range than this [m]."""
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


def _join_measured(parts: list[tuple[str, slice]], world: World) -> list[tuple[str, slice | np.ndarray]]:
    """Return (source, ids) for each part of the observation, neighbours among MuJoCo's sensors as one."""
    ids = {"hinge_angle": world.hinge_qpos, "hinge_rate": world.hinge_dof}
    joined: list[tuple[str, slice | np.ndarray]] = []
    for name, measured in parts:
        if name not in MEASURED:
            joined.append((name, make_slice(ids[name]) if name in ids else slice(0)))
            continue
        before = joined[-1][1] if joined and joined[-1][0] == "measured" else None
        if isinstance(before, slice):
            joined[-1] = ("measured", slice(before.start, measured.stop))
        else:
            joined.append(("measured", measured))
    return joined


class Observer:
    """Reads observations of N simulations.

    Attributes:
        structure: name -> slice of the observation.
        size: length of one observation.
        low: `[size]` smallest values.
        high: `[size]` largest values.
        has_odometry: whether the observation tells it.
        noise: `[size]` standard deviations, scaled by the option `noise`.
    """

    def __init__(self, world: World, num_actions: int) -> None:
        n, h, scout = world.num_modules, world.num_hinges, world.organism.scout
        parts = {
            "hinge_angle": (h, -1.1 * scout.hinge_range, 1.1 * scout.hinge_range),
            "hinge_rate": (h, -_LARGEST_RATE, _LARGEST_RATE),
            "pitch": (n, -pi / 2, pi / 2),
            "roll": (n, -pi, pi),
            "acceleration": (6 * n, -LARGEST_ACCELERATION, LARGEST_ACCELERATION),
            "ir": (2 * len(find_free_sides(world.organism)), 0.0, scout.ir_range),
            "contact": (n, 0.0, LARGEST_TOUCH),
            "previous_action": (num_actions, -1.0, 1.0),
            "hinge_target": (h, -scout.hinge_range, scout.hinge_range),
            "dock_force": (3 * h, -5 * scout.dock_force, 5 * scout.dock_force),
            "odometry": (1, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
            "laser": (NUM_LASER_BEAMS, 0.0, scout.laser_range),
        }
        self.structure: dict[str, slice] = {}
        chosen, start, measured = [(name, *parts[name]) for name in world.config.sensors], 0, 0
        self._measured: dict[str, slice] = {}
        for name, size, _, _ in chosen:
            self.structure[name] = slice(start, start + size)
            start += size
            if name in MEASURED:
                self._measured[name] = slice(measured, measured + size)
                measured += size
        self.size = start
        self.low = np.concatenate([np.full(size, low) for _, size, low, _ in chosen])
        self.high = np.concatenate([np.full(size, high) for _, size, _, high in chosen])
        self.noise = world.config.noise * np.concatenate(
            [np.full(size, _NOISE.get(name, 0.0)) for name, size, _, _ in chosen]
        )
        self._raw_low, self._raw_high = self.low[None].copy(), self.high[None].copy()
        self._pitch = self.structure.get("pitch")
        if self._pitch is not None:
            self._raw_low[:, self._pitch], self._raw_high[:, self._pitch] = -1.0, 1.0
        self.has_odometry = "odometry" in self.structure
        self._rays = [
            (self.structure[name], reach < _NOTHING_HIT)
            for name, reach in (("ir", scout.ir_range), ("laser", scout.laser_range))
            if name in self.structure
        ]
        self._sources = _join_measured(
            [(name, self._measured.get(name, slice(0))) for name in self.structure], world
        )
        self._is_live = all(isinstance(ids, slice) for _, ids in self._sources)
        self._told = [(k, name) for k, (name, _) in enumerate(self._sources) if name in _TOLD]
        self._roll = next((k for k, (name, _) in enumerate(self._sources) if name == "roll"), None)
        self._physics: Physics | None = None
        self._parts: list[np.ndarray] = []
        self._up: tuple[np.ndarray, ...] = ()

    def read(
        self, physics: Physics, previous_action: np.ndarray, target: np.ndarray, odometry: np.ndarray
    ) -> np.ndarray:
        """Return noiseless observations `[N, size]`, within their bounds; not a number becomes 0."""
        if physics is not self._physics or not self._is_live:
            self._physics, self._parts = physics, self._find_parts(physics)
        parts = self._parts
        if self._roll is not None:
            parts[self._roll] = np.arctan2(*self._up)
        for k, name in self._told:
            if name == "previous_action":
                parts[k] = previous_action
            else:
                parts[k] = target if name == "hinge_target" else odometry[:, None]
        out = np.concatenate(parts, axis=1)
        if isnan(np.vdot(out, out)):
            np.copyto(out, 0.0, where=np.isnan(out))
        for part, is_short in self._rays:
            ranges = out[:, part]
            if is_short:
                np.abs(ranges, out=ranges)
            else:
                np.copyto(ranges, _LARGEST_DISTANCE, where=ranges < 0.0)
        np.minimum(np.maximum(out, self._raw_low, out=out), self._raw_high, out=out)
        if self._pitch is not None:
            pitch = out[:, self._pitch]
            np.arcsin(pitch, out=pitch)
        return out

    def _find_parts(self, physics: Physics) -> list[np.ndarray]:
        """Return what each part is read from; as views they stay what they are while the physics goes on."""
        self._up = physics.rotation[:, :, 7], physics.rotation[:, :, 8]
        parts = []
        for name, ids in self._sources:
            if name == "measured":
                parts.append(physics.sensordata[:, ids])
            elif name == "hinge_angle":
                parts.append(physics.qpos[:, ids])
            elif name == "hinge_rate":
                parts.append(physics.qvel[:, ids])
            else:
                parts.append(physics.rotation[:, :, 6])
        return parts


def add_noise(observation: np.ndarray, observer: Observer, generator: np.random.Generator) -> np.ndarray:
    """Return one observation `[size]` with sensor noise, within its bounds."""
    noisy = observation + observer.noise * generator.standard_normal(observer.size)
    return np.clip(noisy, observer.low, observer.high)
