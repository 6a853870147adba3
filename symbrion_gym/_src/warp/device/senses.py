"""Observations on a device: the parts of `Observer` and `DeadReckoning`, as functions of arrays of JAX."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.environment.dead_reckoning import LEAST_LEVEL, find_middle, find_motion, list_places
from symbrion_gym._src.environment.observation import LARGEST_DISTANCE, NOTHING_HIT, Observer
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.robot.organism_sensors import MEASURED
from symbrion_gym._src.warp.device.state import DeviceState, Episode


class DeviceObserver:
    """Reads observations of N simulations on a device.

    Args:
        world: world of the simulations.
        observer: that of the host, for the layout and the bounds.
        dt: length of a tick [s].
        is_skid: whether the tracks of both sides run at their own speed.
    """

    def __init__(self, world: World, observer: Observer, dt: float, is_skid: bool) -> None:
        self._world, self._observer, self._dt, self._is_skid = world, observer, dt, is_skid
        self._measured: dict[str, slice] = {}
        start = 0
        for name, part in observer.structure.items():
            if name in MEASURED:
                size = part.stop - part.start
                self._measured[name] = slice(start, start + size)
                start += size
        scout = world.organism.scout
        self._reach = {"ir": scout.ir_range, "laser": scout.laser_range}
        self._reckoning = Reckoning(world) if "goal_direction" in observer.structure else None

    def integrate(self, episode: Episode, physics: Any, track_speed: Float[jax.Array, "N tracks"]) -> Episode:
        """Add the way of a tick to what the body believes."""
        level = jnp.sqrt(jnp.maximum(1.0 - physics.rotation[:, 0, 6] ** 2, 0.0))
        head = track_speed[:, :2].mean(axis=1) if self._is_skid else track_speed[:, 0]
        episode = episode._replace(track_odometry=episode.track_odometry + self._dt * head * level)
        if self._reckoning is None:
            return episode
        moved = self._reckoning.integrate(episode.believed, physics, track_speed * self._dt)
        return episode._replace(believed=moved, headed=self._reckoning.pass_places(moved, episode.headed))

    def read(self, state: DeviceState, episode: Episode, physics: Any) -> Float[jax.Array, "N O"]:
        """Return noiseless observations, within their bounds; not a number becomes 0."""
        parts = [self._read_part(name, state, episode, physics) for name in self._observer.structure]
        raw = jnp.concatenate(parts, axis=1)
        raw = jnp.where(jnp.isnan(raw), 0.0, raw)
        return jnp.clip(
            raw,
            np.asarray(self._observer.low, dtype=np.float32),
            np.asarray(self._observer.high, dtype=np.float32),
        )

    def _read_part(self, name: str, state: DeviceState, episode: Episode, physics: Any) -> jax.Array:
        rotation = physics.rotation
        if name in self._measured:
            return self._read_measured(name, physics.sensordata)
        if name == "pitch":
            return jnp.arcsin(jnp.clip(rotation[:, :, 6], -1.0, 1.0))
        if name == "roll":
            return jnp.arctan2(rotation[:, :, 7], rotation[:, :, 8])
        if name == "goal":
            return _find_goal(state)
        if name == "goal_direction":
            assert self._reckoning is not None
            return self._reckoning.find_direction(episode.believed, episode.headed)
        simple: dict[str, Any] = {
            "hinge_angle": lambda: physics.qpos[:, self._world.hinge_qpos],
            "hinge_rate": lambda: physics.qvel[:, self._world.hinge_dof],
            "previous_action": lambda: episode.action,
            "hinge_target": lambda: episode.target,
            "odometry": lambda: (state.along[:, 0] - episode.start_head)[:, None],
            "track_odometry": lambda: episode.track_odometry[:, None],
        }
        return simple[name]()

    def _read_measured(self, name: str, sensordata: Float[jax.Array, "N S"]) -> jax.Array:
        """Return readings; a ray that hits nothing reads -1."""
        found = sensordata[:, self._measured[name]]
        if name not in self._reach:
            return found
        if self._reach[name] < NOTHING_HIT:
            return jnp.abs(found)
        return jnp.where(found < 0.0, LARGEST_DISTANCE, found)


def _find_goal(state: DeviceState) -> Float[jax.Array, "N 2"]:
    """Return the place to head for as the head sees it; zeros where a task has none."""
    head = state.position[:, 0, :2]
    target = jnp.asarray(state.target)
    x, y = (jnp.where(jnp.isfinite(target), target, head) - head).T
    c, s = state.rotation[:, 0, 0], state.rotation[:, 0, 3]
    length = jnp.maximum(jnp.hypot(c, s), 1e-9)
    return jnp.stack([(x * c + y * s) / length, (y * c - x * s) / length], axis=1)


class Reckoning:
    """Where bodies believe they are, and what they head for; see `DeadReckoning`."""

    def __init__(self, world: World) -> None:
        self._ahead, self._left, self._turn = (
            np.asarray(each, dtype=np.float32) for each in find_motion(world.organism)
        )
        places, radii = list_places(world.task.goal, world.scene)
        self._places, self._radii = places.astype(np.float32), radii.astype(np.float32)
        self._middle = find_middle(world.organism)

    def integrate(
        self, pose: Float[jax.Array, "N 3"], physics: Any, way: Float[jax.Array, "N tracks"]
    ) -> Float[jax.Array, "N 3"]:
        """Move the believed poses by the way of a tick [m]."""
        rotation = physics.rotation
        level = jnp.sqrt(jnp.maximum(1.0 - rotation[:, :, 6] ** 2, LEAST_LEVEL**2))
        run = jnp.repeat(way, len(self._ahead) // way.shape[1], axis=1)
        leveled = run * jnp.repeat(level, 2, axis=1)
        ahead, left = leveled @ self._ahead, leveled @ self._left
        turn = (run @ self._turn) * rotation[:, 0, 8] / level[:, 0] ** 2
        heading = pose[:, 2] + 0.5 * turn
        c, s = jnp.cos(heading), jnp.sin(heading)
        return pose + jnp.stack([c * ahead - s * left, s * ahead + c * left, turn], axis=1)

    def pass_places(
        self, pose: Float[jax.Array, "N 3"], headed: Int[jax.Array, " N"]
    ) -> Int[jax.Array, " N"]:
        """Return which places bodies head for, which believe that some have been passed by their middle."""
        c, s = jnp.cos(pose[:, 2]), jnp.sin(pose[:, 2])
        ahead, left = self._middle
        x, y = (jnp.asarray(self._places)[headed] - pose[:, :2]).T
        away = jnp.hypot(x + c * ahead - s * left, y + s * ahead + c * left)
        return headed + (away <= jnp.asarray(self._radii)[headed])

    def find_direction(
        self, pose: Float[jax.Array, "N 3"], headed: Int[jax.Array, " N"]
    ) -> Float[jax.Array, "N 2"]:
        """Return bearing [rad] and distance [m] of the place that is headed for."""
        c, s = jnp.cos(pose[:, 2]), jnp.sin(pose[:, 2])
        x, y = (jnp.asarray(self._places)[headed] - pose[:, :2]).T
        return jnp.stack([jnp.arctan2(c * y - s * x, c * x + s * y), jnp.hypot(x, y)], axis=1)
