"""A tick of N episodes on a device, as two functions around the physics: commands before it, judgment after it."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.environment.episodes import Episodes
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.tasks.terms import Reward, Termination
from symbrion_gym._src.warp.device.ground import DeviceGround
from symbrion_gym._src.warp.device.senses import DeviceObserver
from symbrion_gym._src.warp.device.state import Course, DeviceState, Episode


class Orders(NamedTuple):
    """What is written to the physics before a tick.

    Attributes:
        control: controls of the actuators.
        surface: rates of what drives, about its axis [rad/s]; none where speeds do not change within an episode.
    """

    control: Float[jax.Array, "N nu"]
    surface: Float[jax.Array, "N T"] | None


class Ended(NamedTuple):
    """How a tick ended.

    Attributes:
        episode: what lasts.
        reward: of the tick.
        terminated: whether the episode ended by what happened.
        truncated: whether it was cut off.
    """

    episode: Episode
    reward: Float[jax.Array, " N"]
    terminated: Bool[jax.Array, " N"]
    truncated: Bool[jax.Array, " N"]


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
        criteria = task.find_criteria(world.organism)
        self.course = Course(world.scene, task.goal, DeviceGround(world.scene), num, config.dt, criteria)
        self._num_tracks, self._hinges = episodes.num_tracks, world.num_hinges
        self._is_skid = config.track_control == "skid"
        self._observer = DeviceObserver(world, episodes.observer, config.dt, self._is_skid)
        self._hold_ticks = max(1, int(np.ceil(criteria.hold_time / config.dt - 1e-9)))
        self._last_tick = round(task.duration / config.dt)
        self._turn = np.float32(world.organism.scout.hinge_speed * config.dt)

    def find_track_speed(self, episode: Episode) -> Float[jax.Array, "N tracks"]:
        """Return commanded track speeds [m/s]; see `Commands.find_track_speed`."""
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
        rate = self._spread(self.find_track_speed(episode)) / world.wheel_radius
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
        episode = self._observer.integrate(episode, physics, self.find_track_speed(episode))
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
