"""What the organism senses: the layout of the observation, its bounds, and how it is read from the physics."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan, pi
from typing import Any

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.environment.world import Physics, World, make_slice
from symbrion_gym._src.robot.organism_sensors import MEASURED, find_free_sides
from symbrion_gym._src.robot.scout_sensors import SensorNoise

_LARGEST_RATE = 20.0  # Bound of the hinges' rates [rad/s], beyond what their servos reach
_LARGEST_DISTANCE = 100.0  # Bound of distances along the route [m], beyond any arena
_ANGLE_MARGIN = 1.1  # Hinges give a little beyond their range under load: factor on its bounds
_FORCE_MARGIN = 5
"""Docks never tear: factor on the force that they hold, for the bounds of what they may read."""


def _find_bounds(
    world: World, num_actions: int
) -> dict[str, tuple[int, float | np.ndarray, float | np.ndarray]]:
    """Return name -> size, smallest and largest value of each part of an observation."""
    n, h, scout = world.num_modules, world.num_hinges, world.organism.scout
    angle, docks = world.servo_range, len(world.organism.hinges)
    return {
        "hinge_angle": (h, -_ANGLE_MARGIN * angle, _ANGLE_MARGIN * angle),
        "hinge_rate": (h, -_LARGEST_RATE, _LARGEST_RATE),
        "pitch": (n, -pi / 2, pi / 2),
        "roll": (n, -pi, pi),
        "acceleration": (6 * n, -scout.acceleration_range, scout.acceleration_range),
        "ir": (2 * len(find_free_sides(world.organism)), 0.0, scout.ir_range),
        "contact": (n, 0.0, scout.contact_range),
        "previous_action": (num_actions, -1.0, 1.0),
        "hinge_target": (h, -angle, angle),
        "dock_force": (3 * docks, -_FORCE_MARGIN * scout.dock_force, _FORCE_MARGIN * scout.dock_force),
        "odometry": (1, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
        "track_odometry": (1, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
        "laser": (scout.laser_beams, 0.0, scout.laser_range),
        "goal": (2, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
        "goal_direction": (2, np.array([-pi, 0.0]), np.array([pi, _LARGEST_DISTANCE])),
    }


class Observer:
    """Reads observations of N simulations, on the host in place, on a device as a function."""

    def __init__(self, world: World, num: int, num_actions: int) -> None:
        bounds = _find_bounds(world, num_actions)
        parts = {name: bounds[name] for name in world.config.sensors}
        deviations = world.config.sensor_noise or SensorNoise()
        self.structure: dict[str, slice] = {}  # name -> slice of the observation
        self.size = 0
        for name, (size, _, _) in parts.items():
            self.structure[name] = slice(self.size, self.size + size)
            self.size += size
        self.low = np.concatenate([np.full(size, low) for size, low, _ in parts.values()])
        self.high = np.concatenate([np.full(size, high) for size, _, high in parts.values()])
        self.noise = world.config.noise * np.concatenate(
            [np.full(size, getattr(deviations, name, 0.0)) for name, (size, _, _) in parts.items()]
        )
        self._sources = self._list_sources(world)
        # What is no reading of the physics, name -> `[N, size]`; the caller keeps it up to date.
        self.own = {name: np.zeros((num, size)) for name, (size, _, _) in parts.items()}
        self._rays = [self.structure[name] for name in ("ir", "laser") if name in parts]
        self._raw_low, self._raw_high = (np.tile(bound, (num, 1)) for bound in (self.low, self.high))
        pitch = self.structure.get("pitch", slice(0, 0))
        self._raw_low[:, pitch], self._raw_high[:, pitch] = -1.0, 1.0  # its sine
        self._is_live = all(isinstance(ids, slice) for _, ids in self._sources)
        self._physics: Physics | None = None

    def _list_sources(self, world: World) -> list[tuple[str, slice | np.ndarray]]:
        """Return (source, ids) for each part of the observation, neighbors among MuJoCo's sensors as one."""
        ids = {"hinge_angle": world.hinge_qpos, "hinge_rate": world.hinge_dof}
        sources: list[tuple[str, slice | np.ndarray]] = []
        start = 0
        for name, part in self.structure.items():
            if name not in MEASURED:
                sources.append((name, make_slice(ids[name]) if name in ids else slice(0)))
                continue
            first, start = start, start + part.stop - part.start
            if sources and sources[-1][0] == "measured":
                first = sources.pop()[1].start  # pyright: ignore[reportAttributeAccessIssue]
            sources.append(("measured", slice(first, start)))
        return sources

    def list_parts(self, physics: Any, own: Mapping[str, Any]) -> list[Any]:
        """Return what an observation is joined from, as views of the physics where its ids follow each other."""
        parts = []
        for name, ids in self._sources:
            if name == "measured":
                parts.append(physics.sensordata[:, ids])
            elif name == "hinge_angle":
                parts.append(physics.qpos[:, ids])
            elif name == "hinge_rate":
                parts.append(physics.qvel[:, ids])
            else:
                parts.append(physics.rotation[:, :, 6] if name == "pitch" else own[name])
        return parts

    def limit(self, raw: Float[Any, "N size"], xp: Any) -> Float[Any, "N size"]:
        """Return observations within their bounds, of arrays of a device; see `read`."""
        is_ray, is_pitch = np.zeros((2, self.size), dtype=bool)
        for part in self._rays:
            is_ray[part] = True
        is_pitch[self.structure.get("pitch", slice(0, 0))] = True
        raw = xp.where(xp.isnan(raw), 0.0, raw)
        raw = xp.where(is_ray & (raw < 0.0), _LARGEST_DISTANCE, raw)
        low, high = self._raw_low[0].astype(np.float32), self._raw_high[0].astype(np.float32)
        raw = xp.clip(raw, low, high)
        return xp.where(is_pitch, xp.arcsin(xp.clip(raw, -1.0, 1.0)), raw)

    def read(self, physics: Physics) -> Float[np.ndarray, "N size"]:
        """Return noiseless observations, within their bounds; not a number becomes 0.

        A ray that hits nothing reads -1, and in an observation as far as it reaches.
        """
        if physics is not self._physics or not self._is_live:
            self._bind(physics)
        raw, flat = self._raw, self._flat
        for up, roll in self._rolls:
            np.arctan2(*up, roll)
        np.concatenate(self._parts, -1, raw)
        if isnan(flat.dot(flat)):
            np.copyto(raw, 0.0, where=np.isnan(raw))
        for ranges in self._ranges:
            np.copyto(ranges, _LARGEST_DISTANCE, where=ranges < 0.0)
        np.maximum(raw, self._low, out=raw)
        np.minimum(raw, self._high, out=raw)
        for pitch in self._pitches:
            np.arcsin(pitch, pitch)
        return self._rows.copy()

    def _bind(self, physics: Physics) -> None:
        """Look up what parts are read from and written to, as views that stay while the physics goes on.

        One simulation is read along one axis, which is faster than two.
        """
        rows = 0 if len(physics.qpos) == 1 else slice(None)
        self._physics = physics
        self._low, self._high = self._raw_low[rows], self._raw_high[rows]
        self._raw = np.empty_like(self._low)
        self._flat, self._rows = self._raw.reshape(-1), self._raw.reshape(self._raw_low.shape)
        self._parts = [part[rows] for part in self.list_parts(physics, self.own)]
        up = physics.rotation[rows, :, 7], physics.rotation[rows, :, 8]
        self._rolls = [(up, self.own["roll"][rows])] if "roll" in self.structure else []
        self._ranges = [self._raw[..., part] for part in self._rays]
        self._pitches = [self._raw[..., part] for name, part in self.structure.items() if name == "pitch"]

    def add_noise(
        self, observation: Float[np.ndarray, " size"], rng: np.random.Generator
    ) -> Float[np.ndarray, " size"]:
        """Return one observation with sensor noise, within its bounds."""
        noisy = observation + self.noise * rng.standard_normal(self.size)
        return np.clip(noisy, self.low, self.high)
