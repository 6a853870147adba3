"""A tick of N episodes on a device, as two functions around the physics: commands before it, judgment after it."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.dead_reckoning import LEAST_LEVEL, find_middle, find_motion, list_places
from symbrion_gym._src.environment.episodes import Episodes
from symbrion_gym._src.environment.observation import LARGEST_DISTANCE, NOTHING_HIT, Observer
from symbrion_gym._src.environment.warp.device.state import Course, DeviceGround, DeviceState, Episode
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.robot.organism import MEASURED
from symbrion_gym._src.tasks.terms import Reward, Termination


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
            return self._reckoning.compute_direction(episode.believed, episode.headed)
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

    def compute_direction(
        self, pose: Float[jax.Array, "N 3"], headed: Int[jax.Array, " N"]
    ) -> Float[jax.Array, "N 2"]:
        """Return bearing [rad] and distance [m] of the place that is headed for."""
        c, s = jnp.cos(pose[:, 2]), jnp.sin(pose[:, 2])
        x, y = (jnp.asarray(self._places)[headed] - pose[:, :2]).T
        return jnp.stack([jnp.arctan2(c * y - s * x, c * x + s * y), jnp.hypot(x, y)], axis=1)


class Orders(NamedTuple):
    """What is written to the physics before a tick."""

    control: Float[jax.Array, "N nu"]  # controls of the actuators
    # rates of what drives, about its axis [rad/s]; none where speeds do not change within an episode
    surface: Float[jax.Array, "N T"] | None


class Ended(NamedTuple):
    """How a tick ended."""

    episode: Episode  # what lasts
    reward: Float[jax.Array, " N"]  # of the tick
    terminated: Bool[jax.Array, " N"]  # whether the episode ended by what happened
    truncated: Bool[jax.Array, " N"]  # whether it was cut off


class DeviceTick:
    """The tick of a task, from the same terms as on the host.

    Args:
        world: world of the simulations.
        episodes: those of the host, for names and layouts.
        num: number of simulations.
        max_ticks: truncates sooner than the task; None for never.
    """

    def __init__(self, world: World, episodes: Episodes, num: int, max_ticks: int | None) -> None:
        task, config = world.task, world.config
        self._world, self._task, self._max_ticks = world, task, max_ticks
        criteria = task.compute_criteria(world.organism)
        self.course = Course(world.scene, task.goal, DeviceGround(world.scene), num, config.dt, criteria)
        self._num_tracks, self._hinges = episodes.num_tracks, world.num_hinges
        self._is_skid = config.track_control == "skid"
        self._observer = DeviceObserver(world, episodes.observer, config.dt, self._is_skid)
        self._hold_ticks = max(1, int(np.ceil(criteria.hold_time / config.dt - 1e-9)))
        self._last_tick = round(task.duration / config.dt)
        self._turn = np.float32(world.organism.scout.hinge_speed * config.dt)

    def compute_track_speed(self, episode: Episode) -> Float[jax.Array, "N tracks"]:
        """Return commanded track speeds [m/s]; see `Commands.compute_track_speed`."""
        speed = episode.track_speed[:, None]
        return speed * episode.action[:, -self._num_tracks :] if self._num_tracks else speed

    def command(self, episode: Episode, actions: Float[jax.Array, "N A"]) -> tuple[Episode, Orders]:
        """Take actions: move the servos' targets at their speed. What is no number leaves the action as it was."""
        world, limit = self._world, np.float32(self._world.servo_range)
        actions = jnp.where(jnp.isfinite(actions), actions, episode.action)
        action = jnp.clip(actions, -1.0, 1.0)
        turn = action[:, : self._hinges] * limit - episode.target
        target = episode.target + jnp.clip(turn, -self._turn, self._turn)
        episode = episode._replace(action=action, target=target)
        control = jnp.zeros((len(action), world.model.nu), dtype=action.dtype)
        control = control.at[:, world.hinge_servos].set(target)
        rate = self._spread(self.compute_track_speed(episode)) / world.wheel_radius
        if len(world.wheel_servos):
            return episode, Orders(control.at[:, world.wheel_servos].set(rate), None)
        return episode, Orders(control, rate if self._num_tracks else None)

    def _spread(self, speed: Float[jax.Array, "N tracks"]) -> Float[jax.Array, "N T"]:
        """Return the speed at each of what drives, alike in a body, a module, or a side of a module [m/s]."""
        modules, wheels = self._world.track_geoms.shape
        speed = speed[:, :, None]
        if speed.shape[1] == 2 * modules:
            speed = jnp.repeat(speed.reshape(-1, modules, 2), wheels // 2, axis=2)
        return jnp.broadcast_to(speed, (len(speed), modules, wheels)).reshape(len(speed), -1)

    def finish(self, episode: Episode, physics: Any) -> Ended:
        """Return how a tick ended whose physics has just been stepped."""
        world, course = self._world, self.course
        state = DeviceState(
            course,
            episode,
            physics.position,
            physics.rotation,
            physics.qvel,
            physics.qvel[:, world.hinge_dof],
            physics.actuator_force[:, world.hinge_servos],
        )
        held, flags, terminated, truncated = self._judge(state, episode)
        gained = self._reward(state, terminated | truncated)
        if self._max_ticks is not None:
            truncated |= (state.tick > self._max_ticks - 0.5) & ~terminated
        head = jnp.where(state.is_sound, state.along[:, 0], state.start_mean)
        numbers = [head, state.progress - state.start_progress, state.time, *gained]
        numbers += [state.lowest, state.least_up]
        episode = self._observer.integrate(episode, physics, self.compute_track_speed(episode))
        episode = episode._replace(
            progress=state.progress,
            tick=state.tick,
            was_ahead=state.was_ahead,
            held=held,
            memory=state.memory,
            numbers=jnp.stack(numbers, axis=1),
            flags=flags,
            observation=self._observer.read(state, episode, physics),
        )
        total = sum(gained[1:], gained[0]) if gained else jnp.zeros(course.num)
        return Ended(episode, total, terminated, truncated)

    def _judge(
        self, state: DeviceState, episode: Episode
    ) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
        """Return for how long bodies have arrived, the flags, and which episodes are over or cut off."""
        failed = ~state.is_sound
        is_over, is_cut, found = failed, state.tick >= self._last_tick, []
        for term in self._task.terminations:
            each = self._call(term, state)
            if term.truncates:
                is_cut |= each
            else:
                each &= state.is_sound
                is_over |= each
            if term.is_failure:
                failed |= each
            found.append(each)
        has_arrived = self._task.goal.has_arrived(state) & ~failed  # pyright: ignore
        held = jnp.where(has_arrived, episode.held + 1.0, 0.0)
        success = held >= self._hold_ticks
        state.failed, state.success = failed, success
        terminated = is_over | success
        flags = jnp.stack([success, ~state.is_sound, *found], axis=1)
        return held, flags, terminated, is_cut & ~terminated

    def _reward(self, state: DeviceState, has_ended: jax.Array) -> list[jax.Array]:
        """Return the terms of the reward, in their order."""
        gained = []
        for term in self._task.rewards:
            factor = term.weight * (self.course.dt if term.per_second else 1.0)
            each = self._call(term, state) * factor
            gained.append(jnp.where(has_ended, each, 0.0) if term.at_end else each)
        return gained

    def _call(self, term: Termination | Reward, state: DeviceState) -> jax.Array:
        """Return what a term finds; a constant becomes one of the device."""
        return jnp.asarray(term.function(state))  # pyright: ignore[reportArgumentType]
