"""The environment many at once, wholly on a device: actions in and observations out as arrays of JAX or torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import Any

import jax
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.randomization import Domain, split_options
from symbrion_gym._src.environment.warp.batch import WarpBatch, list_columns, list_driven
from symbrion_gym._src.environment.warp.device.run import (
    DeviceRun,
    RunState,
    convert,
    convert_all,
    find_jax_device,
    give_to_warp,
    take_actions,
    take_from_warp,
)
from symbrion_gym._src.environment.warp.device.starts import StartingEnv, Starts, map_arrays, spread_rows
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError

_CLEARED = ("qvel", "qacc_warmstart")  # State that is 0 where an episode begins


class DeviceBatch(WarpBatch):
    """A `WarpBatch` that neither reads nor writes the arrays of the host.

    Args:
        world: world of the simulations.
        nsim: number of simulations.
        options: those of `WarpBatch`.

    Attributes:
        warp_device: the device in Warp.
        jax_device: the device in JAX.
    """

    def __init__(self, world: World, nsim: int, **options: Any) -> None:
        super().__init__(world.model, nsim, **options)
        self.warp_device = self._device
        self.jax_device = find_jax_device(self._device)
        self._world = world
        self._places = {name: self._make_indices(columns) for name, columns in list_columns(world).items()}
        self._places["qpos"] = self._make_indices(np.arange(world.model.nq))
        self._driven = self._make_indices(list_driven(world))
        self._controls = self._make_indices(np.arange(world.model.nu))
        places = ("site_xpos", "site_xmat") if world.is_by_site else ("xpos", "xmat")
        self._names = ("qpos", "qvel", "sensordata", "actuator_force", *places)
        self._kept: list[Any] = []

    def _make_indices(self, values: np.ndarray) -> Any:
        return self._wp.array(np.asarray(values, dtype=np.int32), dtype=int, device=self._device)

    def _find_target(self, name: str) -> Any:
        """Return a field of the data or the model as `[nsim, C]`."""
        return self._flatten(getattr(self._data if hasattr(self._data, name) else self._model, name))

    def put_starts(self, values: dict[str, Float[np.ndarray, "K C"]]) -> dict[str, Any]:
        """Copy starts to the device; return what `begin` takes."""
        return {
            name: self._wp.array(np.ascontiguousarray(each, dtype=np.float32), device=self._device)
            for name, each in values.items()
        }

    def begin(
        self, starts: dict[str, Any], mask: Bool[jax.Array, " nsim"], numbers: Int[jax.Array, " nsim"]
    ) -> None:
        """Begin episodes in some simulations."""
        from symbrion_gym._src.environment.warp.kernels import clear_chosen, write_chosen

        chosen = [give_to_warp(self._wp, each) for each in (mask, numbers)]
        self._kept += [mask, numbers]
        with self._wp.ScopedDevice(self._device):
            for name, source in starts.items():
                if source.shape[1]:
                    self._wp.launch(
                        write_chosen,
                        dim=(self.nsim, source.shape[1]),
                        inputs=[*chosen, self._places[name], source],
                        outputs=[self._find_target(name)],
                    )
            for name in _CLEARED:
                target = self._find_target(name)
                self._wp.launch(clear_chosen, dim=target.shape, inputs=chosen[:1], outputs=[target])

    def advance(
        self,
        control: Float[jax.Array, "nsim nu"],
        surface: Float[jax.Array, "nsim T"] | None,
        nstep: int,
    ) -> dict[str, jax.Array]:
        """Step all simulations; return their state by the names of `MjData`, as views until the next call."""
        self._kept += [control, surface]
        with self._wp.ScopedDevice(self._device):
            if control.shape[1]:
                self._write_whole("ctrl", self._controls, control)
            if surface is not None:
                self._write_whole("geom_surfacevel", self._driven, surface)
            self._rewind()
            self._launch(nstep)
        return self.view()

    def _write_whole(self, name: str, columns: Any, values: jax.Array) -> None:
        from symbrion_gym._src.environment.warp.kernels import write_all

        source, target = give_to_warp(self._wp, values), self._find_target(name)
        self._wp.launch(write_all, dim=values.shape, inputs=[columns, source], outputs=[target])

    def view(self) -> dict[str, jax.Array]:
        """Return the present state of all simulations, as views that are valid until the next step."""
        found = {name: take_from_warp(self._wp, getattr(self._data, name)) for name in self._names}
        self._kept = []  # what Warp still read has been waited for
        return found

    def warn_of_overflow(self) -> None:
        """Warn once if contacts were dropped; waits for the device."""
        self._look_for_overflow()


_LEAST_STARTS, _MOST_STARTS = 256, 1024
"""Starts that are drawn for automatic resets, by default as many as simulations within these."""


class DeviceVectorEnv(VectorEnv[Any, Any, Any]):
    """Many `OrganismEnv` at once whose observations, rewards, endings and automatic resets stay on the device.

    Made by `gymnasium.make_vec(..., vectorization_mode="vector_entry_point", backend="warp", array="jax")`. The terms
    of the task are the same functions as on the host, called with arrays of JAX in single precision.

    Starts are laid down on the host, with the circumstances of each: `num_starts` of them at every reset of all
    simulations. Simulation i begins at start i, modulo their number, which is that of an `OrganismEnv` with seed
    `seed + i`. An automatic reset begins at one of them at random.

    It takes the options of `WarpVectorEnv`, without `render_mode` and `recorders`; several `stretches` make a
    `StretchedVectorEnv`. And these:

    | argument     | meaning                                                                                       |
    |--------------|-----------------------------------------------------------------------------------------------|
    | `array`      | "jax" or "torch": what `step` takes and returns, on the device of the physics                 |
    | `num_starts` | starts that are drawn; by default as many as simulations, at least 256 and at most 1024       |

    Actions are not checked, as looking at them would wait for the device: what is no number leaves an action as it
    was. With the mode "Disabled", a simulation that is done keeps its last observation and `info` until it is reset.

    Raises:
        MissingExtraError: the extra `gpu` is not installed.
        OptionError: an option is not supported, or JAX does not see the device.
        TaskError: a term of the task does not run on a device.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        array: str = "jax",
        device: str | None = None,
        max_contacts: int | None = None,
        is_deterministic: bool = False,
        num_threads: int | None = None,
        num_starts: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        for name, value in (("num_envs", num_envs), ("num_starts", 1 if num_starts is None else num_starts)):
            if int(value) != value or value < 1:
                raise OptionError(f"{name} must be a whole number above 0, got {value}")
        _refuse_options(options, array)
        self.num_envs, self.array = int(num_envs), array
        self._num_starts = num_starts or min(max(self.num_envs, _LEAST_STARTS), _MOST_STARTS)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self._host = StartingEnv.make(max(self.num_envs, self._num_starts), num_threads, options)
        self.config, self.world, self.model = self._host.config, self._host.world, self._host.model
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self.autoreset_mode,
            "render_fps": round(1.0 / self.config.dt),
        }
        self.observation_structure = self._host.observation_structure
        self.single_action_space = _to_single(self._host.single_action_space)
        self.single_observation_space = _to_single(self._host.single_observation_space)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._run = DeviceRun(
            self.world, self._host.episodes, self.num_envs, max_episode_steps, self.autoreset_mode
        )
        self._run.check(self._host.draw([0], [{}]).episode)
        more = {"device": device, "max_contacts": max_contacts, "is_deterministic": is_deterministic}
        self.batch = DeviceBatch(self.world, self.num_envs, **more)
        self._entropy = np.random.SeedSequence()
        self._pool: tuple[Any, dict[str, Any]] | None = None
        self._own: Starts | None = None
        self._state: RunState | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Lay the organisms down at their starts."""
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)), dtype=bool)
        if mask.shape != (self.num_envs,):
            raise OptionError(
                f"reset_mask has shape {mask.shape}; give one value for each of {self.num_envs}"
            )
        is_partial_first = self.is_before_reset and not mask.all()
        if is_partial_first and not (mask.any() and self.autoreset_mode is AutoresetMode.DISABLED):
            raise OptionError("the first reset is one of all simulations; leave out reset_mask")
        split = split_options(options, self.num_envs)
        is_alike = all(each == split[0] for each in split)
        is_kept = self.autoreset_mode is AutoresetMode.DISABLED or not is_alike
        if is_kept and self.autoreset_mode is not AutoresetMode.DISABLED:
            raise OptionError(
                'reset options of each simulation\'s own need autoreset_mode="Disabled"; give numbers or ranges'
            )
        rows = np.flatnonzero(mask)
        if not len(rows):
            return self._show(mask, {name: np.zeros(self.num_envs) for name in Domain._fields})
        is_pool = not is_kept and len(rows) == self.num_envs
        count = self._count_starts(split[0]) if is_pool else len(rows)
        starts = self._host.draw(
            self._list_seeds(seed, rows, count), [split[rows[i % len(rows)]] for i in range(count)]
        )
        return self._begin(starts, mask, rows, is_pool, seed)

    @property
    def is_before_reset(self) -> bool:
        """Whether no episode has begun yet."""
        return self._state is None

    def _count_starts(self, options: Mapping[str, Any]) -> int:
        """Return how many starts are drawn; one where nothing is random."""
        wanted = {**self.world.task.start.randomize(), **self.config.randomize, **options}
        is_random = any(np.size(value) > 1 for value in wanted.values())
        return self._num_starts if is_random else 1

    def _list_seeds(self, seed: Any, rows: np.ndarray, count: int) -> list[Any]:
        if seed is None:
            return self._entropy.spawn(1)[0].generate_state(count).tolist()
        if isinstance(seed, int | np.integer):
            return [int(seed) + (int(rows[i]) if i < len(rows) else i) for i in range(count)]
        if len(seed) != self.num_envs:
            raise OptionError(f"{len(seed)} seeds for {self.num_envs} environments; give one each")
        fresh = self._entropy.spawn(1)[0].generate_state(count).tolist()
        own = [seed[row] for row in rows]
        return [fresh[i] if i >= len(own) or own[i] is None else own[i] for i in range(count)]

    def _begin(
        self, starts: Starts, mask: np.ndarray, rows: np.ndarray, is_pool: bool, seed: Any
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes at starts: all of them, which the automatic resets take as well, or those of some rows."""
        numbers = np.zeros(self.num_envs, dtype=np.int32)
        numbers[rows] = np.arange(len(rows)) % len(starts.qpos)
        if not is_pool:
            self._own = starts = spread_rows(starts, rows, self.num_envs, self._own)
            numbers = np.arange(self.num_envs, dtype=np.int32)
        device = self.batch.jax_device
        episode = map_arrays(lambda each: jax.device_put(each, device), starts.episode)
        fields = self.batch.put_starts({"qpos": starts.qpos, **starts.fields})
        if is_pool or self.autoreset_mode is AutoresetMode.DISABLED or self._pool is None:
            self._pool = episode, fields
        where, which = (jax.device_put(each, device) for each in (mask, numbers))
        self.batch.begin(fields, where, which)
        if self._state is None or (mask.all() and seed is not None):
            first = next((each for each in np.ravel(seed) if each is not None), None)
            first = int(self._entropy.generate_state(1)[0]) if first is None else int(first)
            self._state = self._run.make_state(episode, first, device)
        self._state = self._run.restart(self._state, episode, where, which)
        return self._show(mask, {name: values[numbers] for name, values in starts.domains.items()})

    def _show(self, mask: np.ndarray, domains: Mapping[str, np.ndarray]) -> tuple[Any, dict[str, Any]]:
        """Return what a reset of some simulations returns."""
        assert self._state is not None
        device = self.batch.jax_device
        where = jax.device_put(mask, device)
        info = self._run.describe(self._state, where)
        for name, values in domains.items():
            own = np.where(mask, values, 0.0).astype(np.float32)
            info |= {name: jax.device_put(own, device), f"_{name}": where}
        return self._convert(self._state.episode.observation), convert_all(info, self.array)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass in every simulation that is not done."""
        if self._state is None or self._pool is None:
            raise OptionError("reset the environment before its first step")
        actions = take_actions(actions, self.batch.jax_device)
        if actions.shape != self.action_space.shape:
            raise OptionError(f"actions have shape {self.action_space.shape}, got {actions.shape}")
        commanded, orders = self._run.command(self._state, actions)
        physics = self.batch.advance(orders.control, orders.surface, self.config.frame_skip)
        episode, fields = self._pool
        self._state, out = self._run.finish(self._state, commanded, physics, episode)
        self.batch.begin(fields, out.stale, out.numbers)
        found = (out.observation, out.reward, out.terminated, out.truncated)
        observation, reward, terminated, truncated = map(self._convert, found)
        return observation, reward, terminated, truncated, convert_all(out.info, self.array)

    def time_parts(self, actions: Any) -> tuple[float, float, float]:
        """Take a step and return what commands, physics, and terms with resets take, one after the other [s]."""
        assert self._state is not None
        assert self._pool is not None
        times = [perf_counter()]
        commanded, orders = jax.block_until_ready(self._run.command(self._state, actions))
        times.append(perf_counter())
        physics = self.batch.advance(orders.control, orders.surface, self.config.frame_skip)
        jax.block_until_ready(physics)
        times.append(perf_counter())
        self._state, out = self._run.finish(self._state, commanded, physics, self._pool[0])
        self.batch.begin(self._pool[1], out.stale, out.numbers)
        jax.block_until_ready(out)
        return times[1] - times[0], times[2] - times[1], perf_counter() - times[2]

    def find_running(self) -> Any:
        """Return which simulations have an episode that has not ended, as an array of JAX."""
        if self._state is None:
            return np.zeros(self.num_envs, dtype=bool)
        return ~self._state.is_done

    def _convert(self, array: jax.Array) -> Any:
        return convert(array, self.array)

    def close_extras(self, **kwargs: Any) -> None:
        """Say whether contacts were dropped."""
        self.batch.warn_of_overflow()


def _to_single(space: Any) -> spaces.Box:
    return spaces.Box(space.low.astype(np.float32), space.high.astype(np.float32), dtype=np.float32)


def _refuse_options(options: Mapping[str, Any], array: str) -> None:
    """Refuse options that need the host."""
    for name in ("render_mode", "recorders", "timers"):
        if options.get(name):
            raise OptionError(f"array={array!r} has no {name}; leave out array, or {name}")
