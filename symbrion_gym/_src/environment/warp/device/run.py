"""N running simulations on a device: one compiled function before the physics of a tick, and one after it."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.episodes import Episodes
from symbrion_gym._src.environment.warp.device.state import Episode
from symbrion_gym._src.environment.warp.device.tick import DeviceTick, Orders
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError, TaskError

_DIVERGED = 1  # Column of its flag


class RunState(NamedTuple):
    """What lasts from tick to tick."""

    episode: Episode  # of each simulation
    is_done: Bool[jax.Array, " N"]  # whether its episode has ended, and the next has not begun
    key: jax.Array  # of JAX, for automatic resets and noise


class StepResult(NamedTuple):
    """What a tick returns."""

    observation: Float[jax.Array, "N O"]  # of all simulations
    reward: Float[jax.Array, " N"]  # of the tick
    terminated: Bool[jax.Array, " N"]  # whether the episode ended by what happened
    truncated: Bool[jax.Array, " N"]  # whether it was cut off
    info: dict[str, Any]  # see `OrganismVectorEnv`
    stale: Bool[jax.Array, " N"]  # simulations whose physics begins at a start
    numbers: Int[jax.Array, " N"]  # the start of each of them


class DeviceRun:
    """Ticks of N simulations with automatic resets.

    Args:
        world: world of the simulations.
        episodes: those of the host.
        num: number of simulations.
        max_ticks: truncates sooner than the task; None for never.
        mode: of automatic resets.
    """

    def __init__(
        self, world: World, episodes: Episodes, num: int, max_ticks: int | None, mode: AutoresetMode
    ) -> None:
        self._world, self._num, self._mode = world, num, mode
        self._tick = DeviceTick(world, episodes, num, max_ticks)
        self._names = episodes.number_names, episodes.flag_names
        observer = episodes.observer
        self._noise = np.asarray(observer.noise, dtype=np.float32)
        self._bounds = np.asarray(observer.low, dtype=np.float32), np.asarray(observer.high, dtype=np.float32)
        self._command, self._finish = jax.jit(self._tick.command), jax.jit(self._finish_tick)
        self._restart = jax.jit(self._begin_some)

    def make_state(self, starts: Episode, seed: int, device: Any) -> RunState:
        """Return the state before the first reset."""
        with jax.default_device(device):
            numbers = jnp.zeros(self._num, dtype=jnp.int32)
            episode = jax.tree.map(lambda each: each[numbers], starts)
            return RunState(episode, jnp.ones(self._num, dtype=bool), jax.random.key(seed % 2**32))

    def check(self, starts: Episode) -> None:
        """Trace a tick, so that terms that do not run on a device are refused before anything is compiled."""
        model, num = self._world.model, self._num
        sizes = {
            "qpos": model.nq,
            "qvel": model.nv,
            "sensordata": model.nsensordata,
            "actuator_force": model.nu,
        }
        shapes: dict[str, tuple[int, ...]] = {name: (num, size) for name, size in sizes.items()}
        for count, kind in ((model.nbody, "x"), (model.nsite, "site_x")):
            shapes |= {f"{kind}pos": (num, count, 3), f"{kind}mat": (num, count, 3, 3)}
        physics = {name: jax.ShapeDtypeStruct(shape, np.float32) for name, shape in shapes.items()}
        state = jax.eval_shape(lambda each: self.make_state(each, 0, None), starts)
        try:
            jax.eval_shape(self._finish_tick, state, state.episode, physics, starts)
        except (jax.errors.JAXTypeError, jax.errors.JAXIndexError, TypeError, AttributeError) as error:
            raise TaskError(
                f"task {self._world.task.name!r} has a term that does not run on a device: "
                f"{str(error).splitlines()[0]} Leave out array, or write the term with state.xp, keep() and confirm()"
            ) from error

    def restart(
        self, state: RunState, starts: Episode, mask: Bool[jax.Array, " N"], numbers: Int[jax.Array, " N"]
    ) -> RunState:
        """Begin episodes in some simulations."""
        return self._restart(state, starts, mask, numbers)

    def describe(self, state: RunState, mask: Bool[jax.Array, " N"]) -> dict[str, Any]:
        """Return `info` with Gymnasium's masks."""
        return self._describe(state.episode, mask)

    def command(self, state: RunState, actions: Float[jax.Array, "N A"]) -> tuple[Episode, Orders]:
        """Take actions; see `DeviceTick.command`."""
        return self._command(state.episode, actions)

    def finish(
        self, state: RunState, commanded: Episode, physics: dict[str, jax.Array], starts: Episode
    ) -> tuple[RunState, StepResult]:
        """Return how a tick ended whose physics has just been stepped, after automatic resets."""
        return self._finish(state, commanded, physics, starts)

    def _finish_tick(
        self, state: RunState, commanded: Episode, physics: dict[str, jax.Array], starts: Episode
    ) -> tuple[RunState, StepResult]:
        active, before = ~state.is_done, state.episode
        views: Any = self._world.view(partial(_read, physics))  # pyright: ignore[reportArgumentType]
        ended = self._tick.finish(commanded, views)
        key, noise_key, start_key = jax.random.split(state.key, 3)
        episode = ended.episode
        episode = episode._replace(observation=self._add_noise(episode.observation, noise_key))
        episode = _select(active, episode, before)
        terminated, truncated = ended.terminated & active, ended.truncated & active
        has_ended = terminated | truncated
        reset = {
            AutoresetMode.NEXT_STEP: state.is_done,
            AutoresetMode.SAME_STEP: has_ended,
            AutoresetMode.DISABLED: jnp.zeros_like(has_ended),
        }[self._mode]
        diverged = episode.flags[:, _DIVERGED] & has_ended
        numbers = self._choose(start_key, len(starts.tick))
        info = self._describe(episode, active)
        final = episode.observation
        episode = _begin(episode, starts, reset, numbers)
        if self._mode is AutoresetMode.SAME_STEP:
            info = {
                **self._describe(episode, active),
                "final_obs": final,
                "_final_obs": has_ended,
                "final_info": info | {name: has_ended for name in info if name.startswith("_")},
                "_final_info": has_ended,
            }
        reward = jnp.where(active, ended.reward, 0.0)
        after = RunState(episode, (state.is_done | has_ended) & ~reset, key)
        return after, StepResult(
            episode.observation, reward, terminated, truncated, info, reset | diverged, numbers
        )

    def _choose(self, key: jax.Array, count: int) -> Int[jax.Array, " N"]:
        """Return the start of each simulation that is reset: at random, its own where none is automatic."""
        if self._mode is AutoresetMode.DISABLED:
            return jnp.arange(self._num, dtype=jnp.int32)
        return jax.random.randint(key, (self._num,), 0, count, dtype=jnp.int32)

    def _begin_some(self, state: RunState, starts: Episode, mask: jax.Array, numbers: jax.Array) -> RunState:
        episode = _begin(state.episode, starts, mask, numbers)
        return RunState(episode, state.is_done & ~mask, state.key)

    def _add_noise(self, observation: jax.Array, key: jax.Array) -> jax.Array:
        if not self._noise.any():
            return observation
        noisy = observation + self._noise * jax.random.normal(key, observation.shape)
        return jnp.clip(noisy, *self._bounds)

    def _describe(self, episode: Episode, mask: jax.Array) -> dict[str, Any]:
        numbers, flags = self._names
        info: dict[str, Any] = dict(zip(numbers, episode.numbers.T, strict=True))
        info |= dict(zip(flags, episode.flags.T, strict=True))
        return info | {f"_{name}": mask for name in (*numbers, *flags)}


def _begin(episode: Episode, starts: Episode, mask: jax.Array, numbers: jax.Array) -> Episode:
    """Return episodes of which some are at their starts, whose observations have their noise from the host."""
    return _select(mask, jax.tree.map(lambda each: each[numbers], starts), episode)


def _read(physics: dict[str, jax.Array], name: str) -> jax.Array:
    """Return a field of `MjData`, matrices row by row."""
    found = physics[name]
    return found.reshape(*found.shape[:2], 9) if found.ndim == 4 else found


def _select(mask: jax.Array, one: Episode, other: Episode) -> Episode:
    """Return the rows of one episode where a mask holds, and of the other elsewhere."""

    def choose(first: jax.Array, second: jax.Array) -> jax.Array:
        return jnp.where(mask.reshape(mask.shape + (1,) * (first.ndim - 1)), first, second)

    return jax.tree.map(choose, one, other)


def find_jax_device(device: Any) -> Any:
    """Return the device of JAX that is a device of Warp."""
    kind, ordinal = ("cpu", 0) if device.is_cpu else ("cuda", device.ordinal)
    try:
        return jax.devices(kind)[ordinal]
    except (RuntimeError, IndexError) as error:
        raise OptionError(
            f"JAX does not see device {str(device)!r}; install JAX for GPUs: pip install 'jax[cuda12]'"
        ) from error


def give_to_warp(warp: Any, array: jax.Array) -> Any:
    """Return an array of JAX as one of Warp; keep the former as long as the latter is read."""
    return warp.from_dlpack(jax.block_until_ready(array))


def take_from_warp(warp: Any, array: Any) -> jax.Array:
    """Return an array of Warp as one of JAX, which changes as Warp writes; use it before that."""
    if not array.device.is_cpu:
        warp.synchronize_device(array.device)
    return jax.dlpack.from_dlpack(array)


def convert(array: jax.Array, kind: str) -> Any:
    """Return an array of JAX as one of another kind, of the same memory."""
    if kind == "torch":
        import torch

        return torch.utils.dlpack.from_dlpack(jax.block_until_ready(array))
    return array


def convert_all(info: dict[str, Any], kind: str) -> dict[str, Any]:
    """Return `info` with its arrays converted, also those of nested ones."""
    return {
        name: convert_all(value, kind) if isinstance(value, dict) else convert(value, kind)
        for name, value in info.items()
    }


def take_actions(actions: Any, device: Any) -> jax.Array:
    """Return actions of any kind as an array of JAX on a device, without a copy where they are there."""
    if isinstance(actions, jax.Array):
        return actions
    if hasattr(actions, "detach"):
        actions = jax.dlpack.from_dlpack(actions.detach().float().contiguous())
        return jax.device_put(actions, device)
    return jax.device_put(np.asarray(actions, dtype=np.float32), device)
