"""What the organism senses: the layout of the observation, its bounds, and how it is read from the physics."""

from __future__ import annotations

from math import isnan, pi

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.environment.world import Physics, World, make_slice
from symbrion_gym._src.robot.organism import MEASURED
from symbrion_gym._src.robot.scout_constants import SensorNoise

_LARGEST_RATE = 20.0  # Bound of the hinges' rates [rad/s], beyond what their servos reach
LARGEST_DISTANCE = 100.0  # Bound of distances along the route [m], beyond any arena
_ANGLE_MARGIN = 1.1  # Hinges give a little beyond their range under load: factor on its bounds
_FORCE_MARGIN = 5
"""Docks never tear: factor on the force that they hold, for the bounds of what they may read."""
NOTHING_HIT = 1.0
"""A ray that hits nothing reads -1, which as a distance is beyond a shorter range than this [m]."""


def _join_measured(parts: list[tuple[str, slice]], world: World) -> list[tuple[str, slice | np.ndarray]]:
    """Return (source, ids) for each part of the observation, neighbors among MuJoCo's sensors as one."""
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
        "ir": (2 * len(world.organism.free_sides), 0.0, scout.ir_range),
        "contact": (n, 0.0, scout.contact_range),
        "previous_action": (num_actions, -1.0, 1.0),
        "hinge_target": (h, -angle, angle),
        "dock_force": (3 * docks, -_FORCE_MARGIN * scout.dock_force, _FORCE_MARGIN * scout.dock_force),
        "odometry": (1, -LARGEST_DISTANCE, LARGEST_DISTANCE),
        "track_odometry": (1, -LARGEST_DISTANCE, LARGEST_DISTANCE),
        "laser": (scout.laser_beams, 0.0, scout.laser_range),
        "goal": (2, -LARGEST_DISTANCE, LARGEST_DISTANCE),
        "goal_direction": (2, np.array([-pi, 0.0]), np.array([pi, LARGEST_DISTANCE])),
    }


class Observer:
    """Reads observations of N simulations.

    Args:
        world: world of the simulations.
        action: the last action, after clipping, kept up to date by the caller.
        target: commanded angles of the servos [rad], likewise.

    Attributes:
        structure: name -> slice of the observation.
        size: length of one observation.
        low: `[size]` smallest values.
        high: `[size]` largest values.
        has_odometry: whether the observation contains it.
        odometry: `[N, 1]` distance traveled by the head since the start [m], kept up to date by the caller.
        has_track_odometry: whether the observation contains it.
        track_odometry: `[N, 1]` position of the head by its tracks [m], kept up to date by the caller.
        has_goal: whether the observation contains it.
        goal: `[N, 2]` place to head for, ahead of the head and to its left [m], kept up to date by the caller.
        goal_direction: `[N, 2]` bearing and distance of the goal by dead reckoning [rad, m], likewise.
        noise: `[size]` standard deviations, scaled by the option `noise`.
    """

    def __init__(
        self, world: World, action: Float[np.ndarray, "N A"], target: Float[np.ndarray, "N h"]
    ) -> None:
        parts, scout = _find_bounds(world, action.shape[1]), world.organism.scout
        self.structure: dict[str, slice] = {}
        selected, start, measured = [(name, *parts[name]) for name in world.config.sensors], 0, 0
        self._measured: dict[str, slice] = {}
        for name, size, _, _ in selected:
            self.structure[name] = slice(start, start + size)
            start += size
            if name in MEASURED:
                self._measured[name] = slice(measured, measured + size)
                measured += size
        self.size = start
        self.low = np.concatenate([np.full(size, low) for _, size, low, _ in selected])
        self.high = np.concatenate([np.full(size, high) for _, size, _, high in selected])
        deviations = world.config.sensor_noise or SensorNoise()
        self.noise = world.config.noise * np.concatenate(
            [np.full(size, getattr(deviations, name, 0.0)) for name, size, _, _ in selected]
        )
        self.odometry, self.track_odometry = np.zeros((2, len(action), 1))
        self.goal, self.goal_direction = np.zeros((2, len(action), 2))
        self._internal = {
            "previous_action": action,
            "hinge_target": target,
            "odometry": self.odometry,
            "track_odometry": self.track_odometry,
            "goal": self.goal,
            "goal_direction": self.goal_direction,
        }
        self._raw_low, self._raw_high = (np.tile(bound, (len(action), 1)) for bound in (self.low, self.high))
        if "pitch" in self.structure:
            pitch = self.structure["pitch"]
            self._raw_low[:, pitch], self._raw_high[:, pitch] = -1.0, 1.0  # its sine
        self.has_odometry = "odometry" in self.structure
        self.has_track_odometry = "track_odometry" in self.structure
        self.has_goal = "goal" in self.structure
        self._rays = [
            (self.structure[name], reach < NOTHING_HIT)
            for name, reach in (("ir", scout.ir_range), ("laser", scout.laser_range))
            if name in self.structure
        ]
        self._sources = _join_measured(
            [(name, self._measured.get(name, slice(0))) for name in self.structure], world
        )
        self._is_live = all(isinstance(ids, slice) for _, ids in self._sources)
        self._physics: Physics | None = None

    def read(self, physics: Physics) -> Float[np.ndarray, "N size"]:
        """Return noiseless observations, within their bounds; not a number becomes 0."""
        if physics is not self._physics or not self._is_live:
            self._bind(physics)
        raw, flat = self._raw, self._flat
        for up, roll in self._rolls:
            np.arctan2(*up, roll)
        np.concatenate(self._parts, -1, raw)
        if isnan(flat.dot(flat)):
            np.copyto(raw, 0.0, where=np.isnan(raw))
        for ranges, is_short in self._ranges:
            if is_short:
                np.abs(ranges, ranges)
            else:
                np.copyto(ranges, LARGEST_DISTANCE, where=ranges < 0.0)
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
        self._parts = [self._find_source(physics, name, ids)[rows] for name, ids in self._sources]
        up = physics.rotation[rows, :, 7], physics.rotation[rows, :, 8]
        names = [name for name, _ in self._sources]
        self._rolls = [(up, self._parts[names.index("roll")])] if "roll" in names else []
        self._ranges = [(self._raw[..., part], is_short) for part, is_short in self._rays]
        self._pitches = [self._raw[..., part] for name, part in self.structure.items() if name == "pitch"]

    def _find_source(self, physics: Physics, name: str, ids: slice | np.ndarray) -> np.ndarray:
        if name == "measured":
            return physics.sensordata[:, ids]
        if name == "hinge_angle":
            return physics.qpos[:, ids]
        if name == "hinge_rate":
            return physics.qvel[:, ids]
        if name == "roll":
            return np.empty(physics.rotation.shape[:2])
        return self._internal[name] if name in self._internal else physics.rotation[:, :, 6]


def add_noise(
    observation: Float[np.ndarray, " size"], observer: Observer, rng: np.random.Generator
) -> Float[np.ndarray, " size"]:
    """Return one observation with sensor noise, within its bounds."""
    noisy = observation + observer.noise * rng.standard_normal(observer.size)
    return np.clip(noisy, observer.low, observer.high)
