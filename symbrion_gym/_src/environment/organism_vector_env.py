"""The environment many at once: one `mujoco.batch.Batch` steps all simulations on threads, of one arena or of many."""

import os
from collections.abc import Sequence
from inspect import signature
from math import isfinite
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco.batch import Batch

from symbrion_gym._src.environment.config import EnvironmentConfig, check_count
from symbrion_gym._src.environment.episodes import Episodes
from symbrion_gym._src.environment.organism_env import OrganismEnv, make_renderer, make_spaces
from symbrion_gym._src.environment.randomization import (
    VARIED,
    Domain,
    begin_episode,
    draw_domain,
    make_nominal_domain,
    split_reset,
)
from symbrion_gym._src.environment.rendering import RENDER_MODES, SceneRenderer
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.registration import KnowsLimits
from symbrion_gym._src.tasks.terms import BASE_FLAGS

_DIVERGED = BASE_FLAGS.index("diverged")


class OrganismVectorEnv(KnowsLimits, VectorEnv[np.ndarray, np.ndarray, np.ndarray]):  # pyright: ignore[reportIncompatibleVariableOverride]
    """Many `OrganismEnv` at once, bit-identical to them for equal seeds and actions.

    Made by `gymnasium.make_vec(..., vectorization_mode="vector_entry_point")` or directly. It takes the
    options of `OrganismEnv`, all simulations having the same arena and organism, and these:

    | argument            | meaning                                                            |
    |---------------------|--------------------------------------------------------------------|
    | `num_envs`          | how many simulations                                               |
    | `num_threads`       | threads that step them; as many as there are processors by default |
    | `autoreset_mode`    | Gymnasium's; "NextStep" by default                                 |
    | `max_episode_steps` | truncates sooner than `duration`                                   |

    With "Disabled", a simulation that is done stands still, costs nothing and keeps its last `info` until it
    is reset with `options={"reset_mask": ...}`.

    Reset options are those of `OrganismEnv`. A number or a tuple (low, high) goes to all, an array or a list
    gives each simulation its own; they also hold for the automatic resets that follow. Generators are one
    per simulation, seeded `seed + i`, or `seed[i]` where a list is given.
    """

    metadata = {**OrganismEnv.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        num_threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 400,
        **options: Any,
    ) -> None:
        if render_mode not in (None, *RENDER_MODES[1:]):
            raise OptionError(f"no render mode {render_mode!r}; there are: {', '.join(RENDER_MODES[1:])}")
        self.config = EnvironmentConfig.from_options(options, [*signature(OrganismVectorEnv).parameters][:-1])
        if self.config.timers:
            raise OptionError("a vector environment has no timers; leave out the option timers")
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self.autoreset_mode,
            "render_fps": round(1.0 / self.config.dt),
        }
        self.render_mode, self._image_size = render_mode, (width, height)
        self.num_envs = check_count("num_envs", num_envs)
        threads = check_count("num_threads", num_threads or os.cpu_count() or 1)
        self.world = World(self.config, (width, height))
        self.model = self.world.model
        self._episodes = Episodes(self.world, self.num_envs, max_episode_steps)
        self._mask_names = tuple(f"_{name}" for name in (*self._episodes.info_names, "reason"))
        self.batch = self._make_batch(min(threads, self.num_envs))
        self._fields = {name: self.batch.expand(name) for name in VARIED}
        self._qpos, self._control = self.batch.bind("qpos"), self.batch.bind("ctrl")
        self._physics = self.world.view(self.batch.bind)
        self.observation_structure = self._episodes.observer.structure
        self.single_action_space, self.single_observation_space = make_spaces(self._episodes)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._rngs = [np.random.default_rng() for _ in range(self.num_envs)]
        self._domains = [make_nominal_domain(self.world)] * self.num_envs
        self._options: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._is_done = np.ones(self.num_envs, dtype=bool)
        self._renderers: list[tuple[mujoco.MjData, SceneRenderer]] = []

    def _make_batch(self, num_threads: int) -> Batch:
        # Where static geoms are left out, each simulation needs an `MjData` of its own.
        skips_static = self.model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        return Batch(self.model, self.num_envs, num_threads, persistent=bool(skips_static))

    def _send(self, *names: str) -> None:
        """Pass on what was written to fields of the model; this batch has it at once."""

    def _refresh(self) -> None:
        if not self.world.is_sliced:
            self._physics = self.world.view(self.batch.bind)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Lay the organisms down at their starts."""
        seeds, (mask, split) = list_seeds(seed, self.num_envs), split_reset(options, self.num_envs)
        rows = np.flatnonzero(mask).tolist()
        for row in rows:
            self._options[row], one = split[row], seeds[row]
            if one is not None:
                self._rngs[row] = seeding.np_random(int(one))[0]
        self._begin(rows)
        info = self._make_info(mask)
        for name in Domain._fields:
            values = np.array([getattr(domain, name) for domain in self._domains])
            info[name], info[f"_{name}"] = np.where(mask, values, 0.0), mask
        return self._add_noise(self._episodes.observe(self._physics), mask), info

    def _begin(self, rows: list[int]) -> None:
        """Lay down the organisms of some simulations."""
        drawn = [draw_domain(self.world, self._options[row], self._rngs[row]) for row in rows]
        self.batch.reset(rows, stage=0)
        for row, domain in zip(rows, drawn, strict=True):
            fields = SimpleNamespace(**{name: values[row] for name, values in self._fields.items()})
            begin_episode(self.world, domain, fields, self._qpos[row], self._control[row])
            self._domains[row] = domain
        self._send(*VARIED)
        self.batch.forward(rows)
        self._refresh()
        self._episodes.begin(self._physics, rows, [domain.track_speed for domain in drawn])
        self._is_done[rows] = False

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass in every simulation that is not done."""
        active = self.command(np.asarray(actions, dtype=np.float64))
        count = np.count_nonzero(active)
        if count:
            self.batch.step(None if count == self.num_envs else active, nstep=self.config.frame_skip)
        return self.finish(active)

    def command(self, actions: np.ndarray) -> np.ndarray:
        """Move the targets of the hinges before the physics; return which simulations are not done."""
        if actions.shape != self.action_space.shape:
            raise OptionError(f"actions have shape {self.action_space.shape}, got {actions.shape}")
        active, episodes = ~self._is_done, self._episodes
        count = np.count_nonzero(active)
        if count:
            target, speed = episodes.command(actions, None if count == self.num_envs else active)
            self._control[:, self.world.servos] = target
            if episodes.commands.num_tracks:
                self.world.write_track_speed(self._fields["geom_surfacevel"], speed)
                self._send("geom_surfacevel")
        return active

    def finish(
        self, active: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Return what `step` does, after the physics of the active simulations."""
        was_done, count = self._is_done, np.count_nonzero(active)
        if count:
            self._refresh()
        ticks = self._episodes.finish_tick(self._physics, None if count == self.num_envs else active)
        reward, terminated, truncated = ticks.reward, ticks.terminated.copy(), ticks.truncated.copy()
        ended = terminated | truncated
        has_ended = np.count_nonzero(ended) > 0
        self._is_done = was_done | ended
        info = self._make_info(active)
        observation = self._add_noise(self._episodes.observe(self._physics), active)
        diverged = self._episodes.flags[_DIVERGED] & ended
        if has_ended and diverged.any():
            self.batch.reset(np.flatnonzero(diverged))
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and was_done.any():
            observation = self._restart(was_done, observation)
        elif self.autoreset_mode is AutoresetMode.SAME_STEP and has_ended:
            final = np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(ended):
                final[row] = observation[row].copy()
            final_info = info | dict.fromkeys(self._mask_names, ended)
            observation = self._restart(ended, observation)
            info = {**self._make_info(active), "final_obs": final, "_final_obs": ended}
            info |= {"final_info": final_info, "_final_info": ended}
        return observation, reward, terminated, truncated, info

    def _restart(self, mask: np.ndarray, observation: np.ndarray) -> np.ndarray:
        rows = np.flatnonzero(mask).tolist()
        self._begin(rows)
        fresh = self._add_noise(self._episodes.observe(self._physics), mask)
        return np.where(mask[:, None], fresh, observation)

    def _make_info(self, mask: np.ndarray) -> dict[str, Any]:
        """Return `info` with Gymnasium's `_name` masks: which simulations a value belongs to."""
        values = *self._episodes.numbers.copy(), *self._episodes.flags.copy()
        info: dict[str, Any] = dict(zip(self._episodes.info_names, values, strict=True))
        info["reason"] = self._episodes.reasons.words[self._episodes.reason]
        return info | dict.fromkeys(self._mask_names, mask)

    def _add_noise(self, observation: np.ndarray, mask: np.ndarray) -> np.ndarray:
        if self.config.noise:
            for row in np.flatnonzero(mask):
                observation[row] = self._episodes.observer.add_noise(observation[row], self._rngs[row])
        return observation

    def read_records(self, row: int) -> dict[str, Any]:
        """Return what the option `recorders` kept of the episode of a simulation, until its next one begins."""
        return self._episodes.read_records(row)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of every sub-environment: its own `domain` and `np_random`, all else is shared."""
        own = {"domain": self._domains, "np_random": self._rngs, "unwrapped": [self] * self.num_envs}
        if name in own:
            return tuple(own[name])
        single = f"single_{name}" if name in ("action_space", "observation_space") else name
        return (getattr(self, single),) * self.num_envs

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method, or read an attribute, of every sub-environment; what all share is called once."""
        if name == "render":
            return self.render() or (None,) * self.num_envs
        if name == "read_records":
            return tuple(self.read_records(row) for row in range(self.num_envs))
        found = self.get_attr(name)
        return (found[0](*args, **kwargs),) * self.num_envs if callable(found[0]) else found

    def render(self) -> tuple[Any, ...] | None:
        """Return one image per simulation in the render mode; None without one."""
        if self.render_mode is None:
            return None
        for _ in range(self.num_envs - len(self._renderers)):
            data = mujoco.MjData(self.model)
            self._renderers.append((data, make_renderer(self.world, data, *self._image_size)))
        frames = []
        for row, (data, renderer) in enumerate(self._renderers):
            self.batch.get_data(row, data)
            mujoco.mj_forward(self.model, data)
            renderer.follow(self._physics.position[row])
            frames.append(renderer.render(self.render_mode))
        return tuple(frames)

    def close_extras(self, **kwargs: Any) -> None:
        """Free what images need."""
        for _, renderer in self._renderers:
            renderer.close()
        self._renderers = []


def list_seeds(seed: int | Sequence[int | None] | None, num: int) -> Sequence[int | None]:
    """Return the seed of each of `num` simulations, None where its generator goes on."""
    if seed is None:
        return [None] * num
    seeds = [seed + i for i in range(num)] if isinstance(seed, int | np.integer) else seed
    if len(seeds) != num:
        raise OptionError(f"{len(seeds)} seeds for {num} environments; give one each")
    return seeds


class ManyArenasVectorEnv(KnowsLimits, VectorEnv[np.ndarray, np.ndarray, np.ndarray]):  # pyright: ignore[reportIncompatibleVariableOverride]
    """Many `OrganismEnv` at once in different arenas, bit-identical to one `OrganismVectorEnv` for each arena.

    Simulation i is in arena i modulo their number A: row `i // A` of `parts[i % A]`. Start, way and goal are those of
    each arena. The arenas are stepped in turn, each on all threads: give each as many simulations as there are.

    Args:
        num_envs: number of simulations N, at least A.
        arenas: names, folders, mesh files or `Arena`s.
        options: other options of `OrganismVectorEnv`; arrays of reset options are `[N]`, as seeds are.

    Raises:
        OptionError: there are no arenas or too few simulations, `arena` is given as well, or spaces differ.
        ArenaError: there is no such arena, or it does not have the start or goal.
    """

    def __init__(self, num_envs: int, arenas: Sequence[Any], **options: Any) -> None:
        if "arena" in options:
            raise OptionError("the options 'arena' and 'arenas' both say where; give one of them")
        if isinstance(arenas, str) or not isinstance(arenas, Sequence) or not arenas:
            raise OptionError(f"arenas must be a list of one or more arenas, got {arenas!r}")
        self.num_envs, count = check_count("num_envs", num_envs), len(arenas)
        if num_envs < count:
            raise OptionError(f"num_envs is {num_envs}, but there are {count} arenas; give each a simulation")
        self._rows = [slice(number, None, count) for number in range(count)]
        sizes = [len(range(num_envs)[rows]) for rows in self._rows]
        self.parts = self._make_parts(sizes, arenas, options)
        first = self.parts[0]
        for name in ("config", "world", "metadata", "render_mode"):
            setattr(self, name, getattr(first, name))
        for name in ("observation_structure", "single_observation_space", "single_action_space"):
            value = getattr(first, name)
            setattr(self, name, value)
            for part in self.parts:
                if getattr(part, name) != value:
                    places = f"{self.world.arena.name!r} and {part.world.arena.name!r}"
                    raise OptionError(
                        f"arenas {places} differ in {name}; give each an environment of its own"
                    )
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def _make_parts(self, sizes: Sequence[int], arenas: Sequence[Any], options: dict[str, Any]) -> list[Any]:
        each = zip(sizes, arenas, strict=True)
        return [OrganismVectorEnv(size, arena=arena, **options) for size, arena in each]

    def _step_parts(self, actions: np.ndarray) -> list[Any]:
        return [part.step(actions[rows]) for part, rows in zip(self.parts, self._rows, strict=True)]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Lay the organisms down at their starts."""
        seeds, (mask, split) = list_seeds(seed, self.num_envs), split_reset(options, self.num_envs)
        found = []
        for part, rows in zip(self.parts, self._rows, strict=True):
            own: dict[str, Any] = {name: [each[name] for each in split[rows]] for name in split[0]}
            found.append(part.reset(seed=seeds[rows], options={**own, "reset_mask": mask[rows]}))
        observations, infos = zip(*found, strict=True)
        return self._join(observations), self._join_infos(infos)

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Let a tick pass in every simulation that is not done, one arena after the other."""
        actions = np.asarray(actions, dtype=np.float64)
        if actions.shape != self.action_space.shape:
            raise OptionError(f"actions have shape {self.action_space.shape}, got {actions.shape}")
        if not isfinite(np.vdot(actions, actions)):  # before any arena is stepped
            active = self._join([~part._is_done for part in self.parts])
            self.parts[0]._episodes.commands.refuse_infinite(actions, active)
        *arrays, infos = zip(*self._step_parts(actions), strict=True)
        observation, reward, terminated, truncated = map(self._join, arrays)
        return observation, reward, terminated, truncated, self._join_infos(infos)

    def _join(self, values: Sequence[np.ndarray | None]) -> np.ndarray:
        """Return an array `[N, ...]` of those of the arenas; zero, or None, where one has none."""
        known = next(each for each in values if each is not None)
        nothing = None if known.dtype == object else known.dtype.type()
        joined = np.full((self.num_envs, *known.shape[1:]), nothing, known.dtype)
        for rows, each in zip(self._rows, values, strict=True):
            joined[rows] = nothing if each is None else each
        return joined

    def _join_infos(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        names = dict.fromkeys(name for info in infos for name in info if name != "final_info")
        joined: dict[str, Any] = {name: self._join([info.get(name) for info in infos]) for name in names}
        if "_final_info" in names:  # where no episode has ended it is `info`, of which no mask holds
            plain = [{name: each for name, each in info.items() if name[0] != "_"} for info in infos]
            finals = [info.get("final_info", each) for info, each in zip(infos, plain, strict=True)]
            joined["final_info"] = self._join_infos(finals)
        return joined

    def _mix(self, values: Sequence[Sequence[Any]]) -> tuple[Any, ...]:
        return tuple(values[row % len(values)][row // len(values)] for row in range(self.num_envs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of every sub-environment, as the environment of its arena does."""
        return self._mix([part.get_attr(name) for part in self.parts])

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method, or read an attribute, of every sub-environment, as the environment of its arena does."""
        return self._mix([part.call(name, *args, **kwargs) for part in self.parts])

    def read_records(self, row: int) -> dict[str, Any]:
        """Return what the option `recorders` kept of the episode of a simulation, until its next one begins."""
        return self.parts[row % len(self.parts)].read_records(row // len(self.parts))

    def render(self) -> tuple[Any, ...] | None:
        """Return one image per simulation in the render mode; None without one."""
        return None if self.render_mode is None else self.call("render")

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environment of each arena."""
        for part in self.parts:
            part.close(**kwargs)
