"""Starts of episodes, drawn on the host: what a device needs to begin an episode without it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.randomization import Domain
from symbrion_gym._src.environment.warp.batch import list_columns
from symbrion_gym._src.environment.warp.device.state import Episode

_MOST_AT_ONCE = 32  # Simulations of the host in which starts are laid down


class Starts(NamedTuple):
    """Starts with their circumstances, K rows each."""

    qpos: Float[np.ndarray, "K nq"]  # generalized coordinates
    fields: dict[str, np.ndarray]  # entries of the model's fields that vary, name -> `[K, columns]`
    episode: Episode  # the episode at its start, with its first observation
    domains: dict[str, np.ndarray]  # circumstances, name -> `[K]`


class StartingEnv(OrganismVectorEnv):
    """An environment that only lays bodies down: the same code as on the host, with bit-identical numbers."""

    _has_called = False

    @classmethod
    def make(cls, num: int, num_threads: int | None, options: Mapping[str, Any]) -> StartingEnv:
        """Return an environment for about `num` starts."""
        return cls(min(num, _MOST_AT_ONCE), num_threads, "Disabled", **options)

    @property
    def episodes(self) -> Any:
        """Episodes of the host."""
        return self._episodes

    def draw(self, seeds: Sequence[Any], options: Sequence[Mapping[str, Any]]) -> Starts:
        """Lay down one body for each seed."""
        if not self._has_called:
            self._call_all()
        parts = [
            self._draw(seeds[first : first + self.num_envs], options[first : first + self.num_envs])
            for first in range(0, len(seeds), self.num_envs)
        ]
        return join_rows(parts)

    def _draw(self, seeds: Sequence[Any], options: Sequence[Mapping[str, Any]]) -> Starts:
        count, num = len(seeds), self.num_envs
        rows = slice(0, count)
        wanted = [*options, *[options[0]] * (num - count)]
        asked: dict[str, Any] = {name: [each[name] for each in wanted] for name in options[0]}
        asked["reset_mask"] = np.arange(num) < count
        observation, info = self.reset(seed=[*seeds, *[None] * (num - count)], options=asked)
        fields = {
            name: self.batch.expand(name).reshape(num, -1)[rows][:, columns].astype(np.float32)
            for name, columns in list_columns(self.world).items()
        }
        domains = {name: np.asarray(info[name])[rows] for name in Domain._fields}
        episode = self._describe(observation, domains["track_speed"], rows)
        return Starts(self._qpos[rows].copy(), fields, episode, domains)

    def _describe(self, observation: np.ndarray, track_speed: np.ndarray, rows: slice) -> Episode:
        """Return the episodes that have just begun, in single precision."""
        episodes, state = self._episodes, self._episodes.state
        reckoning, odometry = episodes.reckoning, episodes.observer.track_odometry[:, 0]
        num = self.num_envs
        found = Episode(
            target=episodes.target,
            action=episodes.action,
            track_speed=np.concatenate([track_speed, np.zeros(num - len(track_speed))]),
            track_odometry=odometry,
            believed=np.zeros((num, 3)) if reckoning is None else reckoning.pose,
            headed=np.zeros(num, dtype=int) if reckoning is None else reckoning.number,
            start_head=episodes.numbers[0],
            start_position=state.start_position,
            start_mean=state.start_mean,
            start_progress=state.start_progress,
            start_way=state.start_way,
            progress=state.progress,
            tick=state.tick,
            was_ahead=state.was_ahead,
            held=np.zeros(num),
            memory=dict(state.memory),
            numbers=episodes.numbers.T,
            flags=episodes.flags.T,
            observation=observation,
        )  # pyright: ignore[reportArgumentType]
        return map_arrays(lambda each: _to_single(each[rows]), found)

    def _call_all(self) -> None:
        """Call all terms once, so that what they remember is known, and begins with every episode from now on."""
        state, task = self._episodes.state, self.world.task
        self.reset(seed=0)
        for term in (*task.terminations, *task.rewards):
            term.function(state)
        task.goal.has_arrived(state)
        self._has_called = True


def _to_single(values: np.ndarray) -> np.ndarray:
    return np.array(values, dtype={"b": bool, "i": np.int32}.get(values.dtype.kind, np.float32))


def map_arrays(function: Any, episode: Episode) -> Episode:
    """Return an episode with a function applied to each of its arrays."""
    values = {name: function(value) for name, value in episode._asdict().items() if name != "memory"}
    memory = {name: function(value) for name, value in episode.memory.items()}
    return Episode(memory=memory, **values)


def join_rows(parts: Sequence[Starts]) -> Starts:
    """Return all rows of several sets of starts."""
    if len(parts) == 1:
        return parts[0]

    def join(each: Sequence[Any]) -> Any:
        if isinstance(each[0], dict):
            return {name: join([one[name] for one in each]) for name in each[0]}
        return np.concatenate(each)

    episode = Episode(*(join(each) for each in zip(*(part.episode for part in parts), strict=True)))
    return Starts(
        join([part.qpos for part in parts]),
        join([part.fields for part in parts]),
        episode,
        join([part.domains for part in parts]),
    )


def spread_rows(starts: Starts, rows: Int[np.ndarray, " R"], num: int, before: Starts | None) -> Starts:
    """Return starts of all simulations, of which some are new."""

    def spread(new: Any, old: Any) -> Any:
        if isinstance(new, dict):
            return {name: spread(value, old and old[name]) for name, value in new.items()}
        if isinstance(new, tuple):
            olds = old or (None,) * len(new)
            return type(new)(*(spread(*pair) for pair in zip(new, olds, strict=True)))  # pyright: ignore
        whole = np.zeros((num, *new.shape[1:]), dtype=new.dtype) if old is None else old.copy()
        whole[rows] = new
        return whole

    return spread(starts, before)
