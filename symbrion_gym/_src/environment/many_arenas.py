"""Vector environments of one arena each, composed to one of many arenas."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from symbrion_gym._src.environment.config import check_count
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv, list_seeds
from symbrion_gym._src.environment.randomization import split_reset
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.registration import KnowsLimits


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
        each = zip(sizes, arenas, strict=True)
        self.parts = [OrganismVectorEnv(size, arena=arena, **options) for size, arena in each]
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
        found = [part.step(actions[rows]) for part, rows in zip(self.parts, self._rows, strict=True)]
        *arrays, infos = zip(*found, strict=True)
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
