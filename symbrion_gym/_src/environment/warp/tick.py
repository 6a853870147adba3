"""A tick of N episodes on a device: commands before the physics; observations, terms and automatic resets after it."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.episodes import Commands, Episodes, add_rewards
from symbrion_gym._src.environment.observation import find_goal, measure_way
from symbrion_gym._src.environment.warp.state import DeviceState, Episode, select
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import TaskError

_DIVERGED = 1  # Column of its flag


class DeviceTick:
    """The tick of a task, from the same terms and functions as on the host; `max_ticks` truncates sooner."""

    def __init__(self, world: World, episodes: Episodes, num: int, max_ticks: int | None) -> None:
        self._world, self._task, self._dt = world, world.task, world.config.dt
        self._commands, self._reasons = Commands(world), episodes.reasons
        self._observer, self._reckoning = episodes.observer, episodes.reckoning
        self._state = DeviceState(world, num)
        hold_time = self._state.criteria.hold_time
        self._hold_ticks = max(1, int(np.ceil(hold_time / self._dt - 1e-9)))
        last_tick = round(world.task.duration / self._dt)
        self._last_tick = last_tick if max_ticks is None else min(last_tick, max_ticks)

    def command(self, episode: Episode, actions: Float[jax.Array, "N A"]) -> tuple[Episode, jax.Array, Any]:
        """Take actions; what is no number leaves the action as it was.

        Return episodes, controls `[N, nu]`, and rates of what drives `[N, T]` [rad/s], if they change in an episode.
        """
        world = self._world
        actions = jnp.where(jnp.isfinite(actions), actions, episode.action)
        action, target = self._commands.take(actions, episode.target, jnp)
        episode = episode._replace(action=action, target=target)
        control = jnp.zeros((len(action), world.model.nu), dtype=action.dtype)
        control = control.at[:, world.hinge_servos].set(target)
        rates = world.compute_rates(self._compute_track_speed(episode), jnp)
        return episode, control, rates if self._commands.num_tracks else None

    def _compute_track_speed(self, episode: Episode) -> Float[jax.Array, "N tracks"]:
        return self._commands.compute_track_speed(episode.track_speed[:, None], episode.action)

    def finish(self, episode: Episode, physics: Any) -> tuple[Episode, jax.Array, jax.Array, jax.Array]:
        """Return episodes, rewards, and which are over or cut off, after a tick of the physics."""
        state = self._state.look(episode, physics)
        held, flags, terminated, truncated = self._judge(state, episode)
        gained = self._reward(state, terminated | truncated)
        head = jnp.where(state.is_sound, state.along[:, 0], state.start_mean)
        numbers = [head, state.progress - state.start_progress, state.time, *gained]
        episode = episode._replace(
            progress=state.progress,
            tick=state.tick,
            was_ahead=state.was_ahead,
            held=held,
            numbers=jnp.stack([*numbers, state.lowest, state.least_up], axis=1),
            flags=flags,
        )
        episode = self._observe(state, episode, physics)
        total: Any = add_rewards(gained) if gained else jnp.zeros(state.num)
        return episode, total, terminated, truncated

    def _observe(self, state: DeviceState, episode: Episode, physics: Any) -> Episode:
        """Return episodes with the way of a tick added to what bodies believe, and their noiseless observations."""
        rotation, speed = physics.rotation, self._compute_track_speed(episode)
        way = measure_way(rotation, self._commands.compute_head_speed(speed), self._dt, jnp)
        episode = episode._replace(track_odometry=episode.track_odometry + way[:, None])
        own: dict[str, Any] = {
            "roll": jnp.arctan2(rotation[:, :, 7], rotation[:, :, 8]),
            "previous_action": episode.action,
            "hinge_target": episode.target,
            "odometry": state.along[:, :1] - episode.start_head[:, None],
            "track_odometry": episode.track_odometry,
        }
        if "goal" in self._observer.structure:
            own["goal"] = find_goal(state)
        seen: Any = state
        own |= {each.name: each.read(seen) for each in self._observer.sensors}
        episode = episode._replace(memory=state.memory)
        if self._reckoning is not None:
            believed = self._reckoning.move(episode.believed, rotation, speed * self._dt, jnp)
            headed, own["goal_direction"] = self._reckoning.pass_places(believed, episode.headed, jnp)
            episode = episode._replace(believed=believed, headed=headed)
        raw = jnp.concatenate(self._observer.list_parts(physics, own), axis=1)
        return episode._replace(observation=self._observer.limit(raw, jnp))

    def _judge(self, state: Any, episode: Episode) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
        """Return for how long bodies have arrived, the flags, and which episodes are over or cut off."""
        failed = ~state.is_sound
        is_over, is_cut, found = failed, state.tick >= self._last_tick, []
        for term in self._task.terminations:
            each: Any = jnp.asarray(term.function(state))
            if term.truncates:
                is_cut |= each
            else:
                each &= state.is_sound
                is_over |= each
            if term.is_failure:
                failed |= each
            found.append(each)
        has_arrived = self._task.goal.has_arrived(state) & ~failed
        held = jnp.where(has_arrived, episode.held + 1.0, 0.0)
        success = held >= self._hold_ticks
        terminated = is_over | success
        state.failed, state.success, state.ended = failed, success, terminated | is_cut
        flags = jnp.stack([success, ~state.is_sound, *found], axis=1)
        return held, flags, terminated, is_cut & ~terminated

    def find_reason(self, episode: Episode) -> Int[jax.Array, " N"]:
        """Return the numbers of the words for why episodes ended; 0 of those that go on."""
        return self._reasons.find(episode.flags.T, episode.tick >= self._last_tick, jnp)

    def _reward(self, state: Any, has_ended: jax.Array) -> list[Any]:
        """Return the terms of the reward, in their order."""
        gained = []
        for term in self._task.rewards:
            each = jnp.asarray(term.function(state)) * term.weight * (self._dt if term.per_second else 1.0)
            gained.append(jnp.where(has_ended, each, 0.0) if term.at_end else each)
        return gained


class RunState(NamedTuple):
    """What lasts from tick to tick."""

    episode: Episode  # of each simulation
    is_done: Bool[jax.Array, " N"]  # whether its episode has ended, and the next has not begun
    key: jax.Array  # of JAX, for automatic resets and noise


class DeviceRun:
    """Ticks of N simulations with automatic resets: compiled functions around the physics."""

    def __init__(
        self, world: World, episodes: Episodes, num: int, max_ticks: int | None, mode: AutoresetMode
    ) -> None:
        self._world, self._num, self._mode = world, num, mode
        self._tick = DeviceTick(world, episodes, num, max_ticks)
        self._names = episodes.number_names, episodes.flag_names
        observer = episodes.observer
        self._noise, *self._bounds = map(np.float32, (observer.noise, observer.low, observer.high))
        self.command, self.finish = jax.jit(self._tick.command), jax.jit(self._finish)
        self.restart = jax.jit(self._restart)

    def make_state(self, starts: Episode, seed: int, device: Any) -> RunState:
        """Return the state before the first reset."""
        with jax.default_device(device):
            numbers = jnp.zeros(self._num, dtype=jnp.int32)
            episode = jax.tree.map(lambda each: each[numbers], starts)
            return RunState(episode, jnp.ones(self._num, dtype=bool), jax.random.key(seed % 2**32))

    def check(self, starts: Episode) -> None:
        """Trace a tick, so that terms that do not run on a device are refused before anything is compiled."""
        data, names = mujoco.MjData(self._world.model), ("qpos", "qvel", "sensordata", "actuator_force")
        physics = {
            name: jax.ShapeDtypeStruct((self._num, *getattr(data, name).shape), np.float32)
            for name in (*names, "xpos", "xmat", "site_xpos", "site_xmat")
        }
        state = jax.eval_shape(lambda each: self.make_state(each, 0, None), starts)
        try:
            jax.eval_shape(self._finish, state, state.episode, physics, starts)
        except (jax.errors.JAXTypeError, jax.errors.JAXIndexError, TypeError, AttributeError) as error:
            raise TaskError(
                f"task {self._world.task.name!r} has a term that does not run on a device: "
                f"{str(error).splitlines()[0]} Leave out array, or write the term with state.xp, keep() and confirm()"
            ) from error

    def _restart(self, state: RunState, starts: Episode, mask: jax.Array, numbers: jax.Array) -> RunState:
        """Begin episodes in some simulations."""
        episode = _begin(state.episode, starts, mask, numbers)
        return RunState(episode, state.is_done & ~mask, state.key)

    def _finish(
        self, state: RunState, commanded: Episode, physics: dict[str, jax.Array], starts: Episode
    ) -> tuple[RunState, tuple[Any, ...], Bool[jax.Array, " N"], Int[jax.Array, " N"]]:
        """Return how a tick ended whose physics has just been stepped, after automatic resets.

        After the state and what `step` returns come the simulations whose physics begins at a start, and which start.
        """
        active, before = ~state.is_done, state.episode
        views: Any = self._world.view(physics.__getitem__)  # pyright: ignore[reportArgumentType]
        views = views._replace(rotation=views.rotation.reshape(self._num, -1, 9))
        episode, reward, terminated, truncated = self._tick.finish(commanded, views)
        key, noise_key, start_key = jax.random.split(state.key, 3)
        seen = self._add_noise(episode.observation, noise_key)
        episode = select(active, episode._replace(observation=seen), before)
        terminated, truncated = terminated & active, truncated & active
        has_ended = terminated | truncated
        reset = {
            AutoresetMode.NEXT_STEP: state.is_done,
            AutoresetMode.SAME_STEP: has_ended,
            AutoresetMode.DISABLED: jnp.zeros_like(has_ended),
        }[self._mode]
        stale = reset | (episode.flags[:, _DIVERGED] & has_ended)
        numbers = jnp.arange(self._num, dtype=jnp.int32)  # each its own
        if self._mode is not AutoresetMode.DISABLED:
            numbers = jax.random.randint(start_key, (self._num,), 0, len(starts.tick), dtype=jnp.int32)
        info, final = self.describe(episode, active), episode.observation
        episode = _begin(episode, starts, reset, numbers)
        if self._mode is AutoresetMode.SAME_STEP:
            info = {
                **self.describe(episode, active),
                "final_obs": final,
                "_final_obs": has_ended,
                "final_info": info | {name: has_ended for name in info if name.startswith("_")},
                "_final_info": has_ended,
            }
        after = RunState(episode, (state.is_done | has_ended) & ~reset, key)
        reward = jnp.where(active, reward, 0.0)
        found = episode.observation, reward, terminated, truncated, info
        return after, found, stale, numbers

    def _add_noise(self, observation: jax.Array, key: jax.Array) -> jax.Array:
        if not self._noise.any():
            return observation
        noisy = observation + self._noise * jax.random.normal(key, observation.shape)
        return jnp.clip(noisy, *self._bounds)

    def describe(self, episode: Episode, mask: jax.Array) -> dict[str, Any]:
        """Return `info` with Gymnasium's masks."""
        numbers, flags = self._names
        info: dict[str, Any] = dict(zip(numbers, episode.numbers.T, strict=True))
        info |= dict(zip(flags, episode.flags.T, strict=True))
        info["reason"] = self._tick.find_reason(episode)
        return info | {f"_{name}": mask for name in (*numbers, *flags, "reason")}


def _begin(episode: Episode, starts: Episode, mask: jax.Array, numbers: jax.Array) -> Episode:
    """Return episodes of which some are at their starts, whose observations have their noise from the host."""
    return select(mask, jax.tree.map(lambda each: each[numbers], starts), episode)
