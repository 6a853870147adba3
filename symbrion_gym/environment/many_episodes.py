"""Many episodes judged at once: the ordinary ticks as arrays, those in which something happens one by one.

Most ticks of most simulations end nothing and arrive nowhere. Limits on what is measured tell which do not;
those go the way of the single environment. All numbers are the same as there, to the bit.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from symbrion_gym.environment.episodes import FLAGS, NUMBERS, STUCK_PROGRESS, Episodes, Tick
from symbrion_gym.environment.world import Physics, World
from symbrion_gym.tasks.success_check import LARGEST_SPEED, ROLLED_OVER, Judge

_HEAD, _GAINED, _TIME, _FORWARD, _, _EFFORT, _LOWEST, _ = range(len(NUMBERS))
_IDLE, _AGE, _SPEED, _LEFT, _REAR, _RIGHT, _LOW, _LEAN = range(8)
"""Rows of what is watched: ticks without moving on, ticks, the fastest coordinate; of the modules the place farthest
left of the route's middle, least far along it, farthest right, lowest [m], and the least z of an up axis."""
_NUM_UPPER = _RIGHT
"""So many rows, the first, have an upper limit, the others a lower one."""


class Ticks(NamedTuple):
    """What a tick came to in every simulation; nothing in those that stood still.

    Attributes:
        reward: `[N]`.
        terminated: `[N]`.
        truncated: `[N]`.
    """

    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray


class ManyEpisodes(Episodes):
    """The memory of N episodes, as arrays.

    Attributes:
        numbers: `[len(NUMBERS), N]` numbers of `info` at the last tick or reset of each.
        flags: `[len(FLAGS), N]` likewise its flags.
    """

    def __init__(self, world: World, num: int) -> None:
        super().__init__(world, num)
        self.numbers = np.zeros((len(NUMBERS), num))
        self.flags = np.zeros((len(FLAGS), num), dtype=bool)
        self._table, self._watch, self._limits = np.zeros((3, 8, num))
        self._is_quiet = np.zeros((len(self._watch), num), dtype=bool)
        self._start_progress, self._progress, self._best, self._best_tick = np.zeros((4, num))
        self._finish = np.zeros(num)
        self._modules = np.zeros((world.num_modules, 4, num))
        self._rates = np.zeros((world.model.nv, num))
        self._power = np.zeros((self._num_hinges, num))
        self._viewed: Physics | None = None
        self._views: tuple[np.ndarray, ...] = ()
        self._is_plain = True
        self._watched: set[int] = set()

    def begin(
        self,
        rows: Iterable[int],
        physics: Physics,
        track_speeds: Iterable[float],
        judges: Iterable[Judge] | None = None,
    ) -> None:
        """Start episodes in the given rows from the present physics; see `Episodes.begin`."""
        rows = list(rows)
        super().begin(rows, physics, track_speeds, judges)
        late, fastest = (self._stuck_ticks - 0.5, self._last_tick - 0.5), np.nextafter(LARGEST_SPEED, 0.0)
        self._is_plain = all(judge.is_plain for judge in self._judges)
        for row in rows:
            judge, episode = self._judges[row], self._episodes[row]
            aside, lowest = judge.find_limits()
            self._limits[:, row] = *late, fastest, aside, judge.finish, -aside, lowest, ROLLED_OVER
            self._finish[row] = judge.finish
            self._start_progress[row] = self._progress[row] = self._best[row] = episode.progress
            self._best_tick[row] = self._watch[_AGE, row] = 0.0
            self._watched.discard(row)
            self._keep_info(row, self.describe_start(physics, row))

    def finish_ticks(self, physics: Physics, listens: np.ndarray) -> Ticks:
        """Judge and reward the tick whose physics has just been stepped.

        Args:
            physics: of all simulations.
            listens: `[N]` whether a simulation is one of those that were stepped.
        """
        if physics is not self._viewed or not self._is_live:
            self._viewed, self._views = physics, self._find_views(physics)
        with np.errstate(all="ignore"):  # what is not a number is looked at closely
            progress = self._measure(physics)
            special = (self._find_quiet() < listens).nonzero()[0].tolist()
            if self._watched:
                special = sorted(self._watched.union(special))
            closely = {row: self._look_closely(physics, row) for row in special if listens[row]}
            reward = self._pass_over(progress)
        np.copyto(self.numbers, self._table, where=listens)
        ended = np.zeros((2, len(listens)), dtype=bool)
        ticks = Ticks(np.where(listens, reward, 0.0), *ended)
        for row, tick in closely.items():
            self._keep(row)
            ticks.reward[row], ticks.terminated[row], ticks.truncated[row], info = tick
            self._keep_info(row, info)
        return ticks

    def _find_views(self, physics: Physics) -> tuple[np.ndarray, ...]:
        """Return what is measured of the physics, as views that stay what they are while it goes on.

        Simulations come last, so that what is found among modules and hinges is found in all at once.
        """
        torque = physics.actuator_force[:, self._servos].T
        return physics.position.transpose(1, 2, 0), physics.rotation[:, :, 8].T, physics.qvel.T, torque

    def _measure(self, physics: Physics) -> np.ndarray:
        """Measure all; return progress."""
        places, up, rates, torque = self._views
        table, watch, best, best_tick = self._table, self._watch, self._best, self._best_tick
        modules, power, speeds, age = self._modules, self._power, self._rates, watch[_AGE]
        modules[:, :3] = places if self._is_plain else self._find_places(physics)
        modules[:, 3] = up
        np.minimum.reduce(modules, axis=0, out=watch[_REAR:])
        np.maximum.reduce(modules[:, 1], axis=0, out=watch[_LEFT])
        table[_HEAD], table[_LOWEST:] = modules[0, 0], watch[_LOW:]
        np.abs(rates, speeds)
        np.maximum.reduce(speeds, axis=0, out=watch[_SPEED])
        np.abs(np.multiply(torque, rates[self._dofs], power), power)
        np.multiply(_add_up(power), self._weights[2], table[_EFFORT])
        progress = _add_up(np.minimum(modules[:, 0], self._finish)) * self.judge.share
        age += 1.0
        has_moved = progress > best + STUCK_PROGRESS
        np.copyto(best, progress, where=has_moved)
        np.copyto(best_tick, age, where=has_moved)
        np.subtract(age, best_tick, watch[_IDLE])
        return progress

    def _find_quiet(self) -> np.ndarray:
        """Return in which simulations nothing that is watched is beyond its limit, `[N]`."""
        watch, limits, quiet, upper = self._watch, self._limits, self._is_quiet, _NUM_UPPER
        np.less_equal(watch[:upper], limits[:upper], quiet[:upper])
        np.greater_equal(watch[upper:], limits[upper:], quiet[upper:])
        return np.logical_and.reduce(quiet, axis=0)

    def _find_places(self, physics: Physics) -> np.ndarray:
        """Return how far along the route, how far left of its middle and how high modules are, `[n, 3, N]` [m]."""
        places = physics.position.transpose(1, 2, 0).copy()
        for row, judge in enumerate(self._judges):
            places[:, 0, row], places[:, 1, row] = judge.find_places(physics.position[row])
        return places

    def _pass_over(self, progress: np.ndarray) -> np.ndarray:
        """Take the tick as an ordinary one everywhere; return rewards."""
        table = self._table
        forward = table[_FORWARD]
        np.subtract(progress, self._start_progress, out=table[_GAINED])
        np.multiply(self._watch[_AGE], self._dt, out=table[_TIME])
        np.multiply(np.subtract(progress, self._progress, out=forward), self._weights[0], out=forward)
        self._progress = progress
        return forward + table[_EFFORT]

    def _keep_info(self, row: int, info: dict[str, float | bool]) -> None:
        values = tuple(info.values())
        self.numbers[:, row], self.flags[:, row] = values[: len(NUMBERS)], values[len(NUMBERS) :]

    def _look_closely(self, physics: Physics, row: int) -> Tick:
        episode = self._episodes[row]
        episode.progress, episode.best = float(self._progress[row]), float(self._best[row])
        episode.ticks, episode.best_tick = int(self._watch[_AGE, row]) - 1, int(self._best_tick[row])
        return self.finish_tick(physics, row)

    def _keep(self, row: int) -> None:
        """Take over what a close look came to."""
        episode = self._episodes[row]
        self._progress[row], self._best[row] = episode.progress, episode.best
        self._best_tick[row] = episode.best_tick
        (self._watched.add if episode.held else self._watched.discard)(row)


def _add_up(values: np.ndarray) -> np.ndarray:
    """Return the sums `[N]` of values `[n, N]`, added one after the other as in plain Python."""
    return np.add.accumulate(values, axis=0)[-1] if len(values) else np.zeros(values.shape[1])
