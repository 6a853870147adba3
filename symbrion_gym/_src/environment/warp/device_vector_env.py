"""The environment many at once, wholly on a device: actions in and observations out as arrays of JAX or torch."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.config import check_count
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.randomization import Domain, split_reset
from symbrion_gym._src.environment.warp.batch import WarpEngine, list_columns
from symbrion_gym._src.environment.warp.state import Episode
from symbrion_gym._src.environment.warp.tick import DeviceRun, RunState
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.registration import KnowsLimits

_MOST_AT_ONCE = 32  # Simulations of the host in which starts are laid down
_DRIVEN = slice(4, None, 6)  # What drives, of surface velocities: the rate of a geom about the lateral axis
_LEAST_STARTS, _MOST_STARTS = 256, 1024
"""Starts that are drawn for automatic resets, by default as many as simulations within these."""


class Starts(NamedTuple):
    """Starts with their circumstances, K rows each."""

    fields: dict[str, np.ndarray]  # what differs in the state and the model, name -> `[K, columns]`
    episode: Episode  # the episode at its start, with its first observation
    domains: dict[str, np.ndarray]  # circumstances, name -> `[K]`


class StartingEnv(OrganismVectorEnv):
    """An environment of the host that only lays bodies down, about `num` of them at a time."""

    def __init__(self, num: int, num_threads: int | None, options: Mapping[str, Any]) -> None:
        super().__init__(min(num, _MOST_AT_ONCE), num_threads, "Disabled", **options)
        self.episodes = self._episodes
        # All terms are called once, so that what they remember is known, and begins with every episode from now on.
        self.reset(seed=0)
        task = self.world.task
        for term in (*task.terminations, *task.rewards):
            term.function(self.episodes.state)
        task.goal.has_arrived(self.episodes.state)

    def draw(self, seeds: Sequence[Any], options: Sequence[Mapping[str, Any]]) -> Starts:
        """Lay down one body for each seed."""
        num = self.num_envs
        parts = [
            self._draw(seeds[first : first + num], options[first : first + num])
            for first in range(0, len(seeds), num)
        ]
        return jax.tree.map(lambda *each: np.concatenate(each), *parts)

    def _draw(self, seeds: Sequence[Any], options: Sequence[Mapping[str, Any]]) -> Starts:
        count, num = len(seeds), self.num_envs
        wanted = [*options, *[options[0]] * (num - count)]
        asked: dict[str, Any] = {name: [each[name] for each in wanted] for name in options[0]}
        asked["reset_mask"] = np.arange(num) < count
        observation, info = self.reset(seed=[*seeds, *[None] * (num - count)], options=asked)
        fields = {"qpos": self._qpos, "qvel": np.zeros((num, self.model.nv))}
        fields["qacc_warmstart"] = fields["qvel"]
        for name, columns in list_columns(self.world).items():
            fields[name] = self.batch.expand(name).reshape(num, -1)[:, columns]
        domains = {name: np.asarray(info[name]) for name in Domain._fields}
        found = Starts(fields, self._describe(observation), domains)
        return jax.tree.map(lambda each: _to_single(each[:count]), found)

    def _describe(self, observation: np.ndarray) -> Episode:
        """Return the episodes that have just begun."""
        episodes, state = self.episodes, self.episodes.state
        kept: dict[str, Any] = {name: getattr(state, name, None) for name in Episode._fields}
        own = ("target", "action", "track_odometry", "believed", "headed")
        return Episode(**kept)._replace(
            **{name: getattr(episodes, name) for name in own},
            start_head=episodes.numbers[0],
            held=np.zeros(self.num_envs),
            numbers=episodes.numbers.T,
            flags=episodes.flags.T,
            observation=observation,
        )


def _to_single(values: np.ndarray) -> np.ndarray:
    return np.array(values, dtype={"b": bool, "i": np.int32}.get(values.dtype.kind, np.float32))


class DeviceBatch(WarpEngine):
    """Simulations that neither read nor write arrays of the host."""

    def __init__(self, world: World, nsim: int, **options: Any) -> None:
        super().__init__(nsim, **options)
        self.add(world)
        self.build()
        self.jax_device = find_jax_device(self.warp_device)
        columns = list_columns(world)
        self._columns = {name: self.make_indices(each) for name, each in columns.items()}
        self._driven = self.make_indices(columns.get("geom_surfacevel", np.zeros(0, dtype=int))[_DRIVEN])
        places = ("site_xpos", "site_xmat") if world.is_by_site else ("xpos", "xmat")
        self._names = ("qpos", "qvel", "sensordata", "actuator_force", *places)
        self._kept: list[Any] = []  # arrays of JAX that Warp may still read

    def put_starts(self, starts: Starts) -> dict[str, Any]:
        """Copy starts to the device; return what `begin` takes."""
        return {
            name: self.warp.array(np.ascontiguousarray(each), dtype=float, device=self.warp_device)
            for name, each in starts.fields.items()
        }

    def begin(
        self, fields: dict[str, Any], mask: Bool[jax.Array, " nsim"], numbers: Int[jax.Array, " nsim"]
    ) -> None:
        """Begin episodes in some simulations."""
        chosen = self._give(mask), self._give(numbers)
        for name, values in fields.items():
            self.write(name, values, self._columns.get(name), *chosen)

    def advance(
        self, control: Float[jax.Array, "nsim nu"], rates: Float[jax.Array, "nsim T"] | None, nstep: int
    ) -> dict[str, jax.Array]:
        """Step all simulations; return their state by the names of `MjData`, as views until the next call."""
        self.write("ctrl", self._give(control))
        if rates is not None:
            self.write("geom_surfacevel", self._give(rates), self._driven)
        self.launch(nstep)
        return self.view()

    def _give(self, array: jax.Array) -> Any:
        """Return an array of JAX as one of Warp."""
        self._kept.append(array)
        return self.warp.from_dlpack(jax.block_until_ready(array))

    def view(self) -> dict[str, jax.Array]:
        """Return the present state of all simulations, as views that are valid until the next step."""
        if not self.warp_device.is_cpu:
            self.warp.synchronize_device(self.warp_device)
        found = {name: jax.dlpack.from_dlpack(getattr(self._data, name)) for name in self._names}
        self._kept.clear()
        return found


class DeviceVectorEnv(KnowsLimits, VectorEnv[Any, Any, Any]):  # pyright: ignore[reportIncompatibleVariableOverride]
    """Many `OrganismEnv` at once of which nothing but starts is on the host; see the page on GPUs.

    Simulation i begins at start i, modulo their number, which is that of an `OrganismEnv` with seed `seed + i`. An
    automatic reset begins at one of them at random.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        array: str = "jax",
        device: str | None = None,
        max_contacts: int | None = None,
        num_threads: int | None = None,
        num_starts: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        self.num_envs, self.array = check_count("num_envs", num_envs), array
        usual = min(max(self.num_envs, _LEAST_STARTS), _MOST_STARTS)
        self._num_starts = check_count("num_starts", usual if num_starts is None else num_starts)
        for name in ("render_mode", "recorders", "timers"):  # they need the host
            if options.get(name):
                raise OptionError(f"array={array!r} has no {name}; leave out array, or {name}")
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self._is_disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._host = host = StartingEnv(max(self.num_envs, self._num_starts), num_threads, options)
        self.config, self.world, self.model = host.config, host.world, host.model
        self.metadata = {**host.metadata, "render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.observation_structure = host.observation_structure
        self.single_action_space, self.single_observation_space = (
            spaces.Box(each.low.astype(np.float32), each.high.astype(np.float32), dtype=np.float32)
            for each in (host.single_action_space, host.single_observation_space)
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._run = DeviceRun(
            self.world, host.episodes, self.num_envs, max_episode_steps, self.autoreset_mode
        )
        self._run.check(host.draw([0], [{}]).episode)
        more = {"device": device, "max_contacts": max_contacts}
        self.batch = DeviceBatch(self.world, self.num_envs, **more)
        self._entropy = np.random.SeedSequence()
        self._starts: tuple[Episode, dict[str, Any]] | None = None  # for automatic resets
        self._state: RunState | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Lay the organisms down at their starts."""
        mask, split = split_reset(options, self.num_envs)
        if not mask.any():
            raise OptionError("reset_mask is False everywhere; leave it out, or name those that begin")
        if not self._is_disabled and not (mask.all() and all(each == split[0] for each in split)):
            raise OptionError(
                "reset_mask and reset options of each simulation's own need autoreset_mode='Disabled'; give numbers or "
                "ranges for all"
            )
        rows, numbers = np.flatnonzero(mask), np.zeros(self.num_envs, dtype=np.int32)
        count = len(rows) if self._is_disabled else self._count_starts(split[0])
        seeds = self._list_seeds(seed, rows, count)
        starts = self._host.draw(seeds, [split[rows[i % len(rows)]] for i in range(count)])
        numbers[rows] = np.arange(len(rows)) % count
        if self._is_disabled:  # each has its own, so that shapes are the same however many begin
            starts = jax.tree.map(lambda each: each[numbers], starts)
            numbers = np.arange(self.num_envs, dtype=np.int32)
        device = self.batch.jax_device
        self._starts = jax.device_put(starts.episode, device), self.batch.put_starts(starts)
        where, which = (jax.device_put(each, device) for each in (mask, numbers))
        self.batch.begin(self._starts[1], where, which)
        state = self._state
        if state is None or (mask.all() and seed is not None):
            first = next((int(each) for each in np.ravel(np.array(seed)) if each is not None), None)
            first = int(self._entropy.generate_state(1)[0]) if first is None else first
            state = self._run.make_state(self._starts[0], first, device)
        self._state = state = self._run.restart(state, self._starts[0], where, which)
        info = self._run.describe(state.episode, where)
        for name, values in starts.domains.items():
            own = np.where(mask, values[numbers], np.float32(0.0))
            info |= {name: jax.device_put(own, device), f"_{name}": where}
        return self._hand_out((state.episode.observation, info))

    def _count_starts(self, options: Mapping[str, Any]) -> int:
        """Return how many starts are drawn; one where nothing is random."""
        wanted = {**self.config.randomize, **options}
        is_random = any(np.size(value) > 1 for value in wanted.values())
        return self._num_starts if is_random else 1

    def _list_seeds(self, seed: Any, rows: np.ndarray, count: int) -> list[Any]:
        fresh = self._entropy.spawn(1)[0].generate_state(count).tolist()
        if seed is None:
            return fresh
        if isinstance(seed, int | np.integer):
            return [int(seed) + (int(rows[i]) if i < len(rows) else i) for i in range(count)]
        if len(seed) != self.num_envs:
            raise OptionError(f"{len(seed)} seeds for {self.num_envs} environments; give one each")
        for i, row in enumerate(rows[:count]):
            fresh[i] = fresh[i] if seed[row] is None else seed[row]
        return fresh

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass in every simulation that is not done."""
        if self._state is None or self._starts is None:
            raise OptionError("reset the environment before its first step")
        actions = take_actions(actions, self.batch.jax_device)
        if actions.shape != self.action_space.shape:
            raise OptionError(f"actions have shape {self.action_space.shape}, got {actions.shape}")
        commanded, control, rates = self._run.command(self._state.episode, actions)
        physics = self.batch.advance(control, rates, self.config.frame_skip)
        episode, fields = self._starts
        self._state, found, stale, numbers = self._run.finish(self._state, commanded, physics, episode)
        self.batch.begin(fields, stale, numbers)
        return self._hand_out(found)

    def _hand_out(self, found: tuple[Any, ...]) -> Any:
        """Return what `reset` or `step` does, in arrays of the wanted library, with words for the reasons."""
        words, info = self._host.episodes.reasons.words, found[-1]
        ends = [each for each in (info, info.get("final_info")) if each is not None]
        numbers = [each.pop("reason") for each in ends]
        found = convert(found, self.array)
        ends = [found[-1], found[-1].get("final_info")]
        for each, number in zip(ends, numbers, strict=False):
            each["reason"] = Words(words, number)
        return found

    def find_running(self) -> Any:
        """Return which simulations have an episode that has not ended, as an array of JAX."""
        return np.zeros(self.num_envs, dtype=bool) if self._state is None else ~self._state.is_done

    def close_extras(self, **kwargs: Any) -> None:
        """Say whether contacts were dropped."""
        self.batch.warn_of_overflow()


class Words:
    """Words by their numbers on a device: an array of text, which is copied from there when it is read."""

    def __init__(self, words: np.ndarray, numbers: Int[jax.Array, " N"]) -> None:
        self._words, self._numbers = words, numbers

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self._words[np.asarray(self._numbers)].astype(dtype or self._words.dtype, copy=False)

    def __getitem__(self, index: Any) -> Any:
        return np.asarray(self)[index]

    def __len__(self) -> int:
        return len(self._numbers)


def find_jax_device(device: Any) -> Any:
    """Return the device of JAX that is a device of Warp."""
    kind, ordinal = ("cpu", 0) if device.is_cpu else ("cuda", device.ordinal)
    try:
        return jax.devices(kind)[ordinal]
    except (RuntimeError, IndexError) as error:
        raise OptionError(
            f"JAX does not see device {str(device)!r}; install JAX for GPUs: pip install 'jax[cuda12]'"
        ) from error


def convert(arrays: Any, kind: str) -> Any:
    """Return arrays of JAX, also nested ones, as those of another kind, of the same memory."""
    if kind != "torch":
        return arrays
    import torch

    return jax.tree.map(lambda each: torch.utils.dlpack.from_dlpack(jax.block_until_ready(each)), arrays)


def take_actions(actions: Any, device: Any) -> jax.Array:
    """Return actions of any kind as an array of JAX on a device, without a copy where they are there."""
    if isinstance(actions, jax.Array):
        return actions
    if hasattr(actions, "detach"):
        actions = jax.dlpack.from_dlpack(actions.detach().float().contiguous())
        return jax.device_put(actions, device)
    return jax.device_put(np.asarray(actions, dtype=np.float32), device)
