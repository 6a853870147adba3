"""Many episodes judged at once: the ordinary ticks as arrays, those in which something happens one by one.

Most ticks of most simulations end nothing and arrive nowhere. Limits on what is measured tell which do not;
those go the way of the single environment. All numbers are the same as there, to the bit.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from symbrion_gym.environment.episodes import FLAGS, NUMBERS, STUCK_PROGRESS, Episodes, Tick
from symbrion_gym.environment.judge import LARGEST_SPEED, ROLLED_OVER, Judge
from symbrion_gym.environment.world import Physics, World

_HEAD, _GAINED, _TIME, _FORWARD, _, _EFFORT, _LOWEST, _UPRIGHT = range(len(NUMBERS))
_MIN, _MAX, (_IDLE, _AGE, _SPEED) = len(NUMBERS), len(NUMBERS) + 3, range(len(NUMBERS) + 6, len(NUMBERS) + 9)
"""Rows of what is measured: the numbers of `info`; the least and the greatest place along the route, left of it
and in height [m]; ticks without moving on, ticks, the fastest coordinate."""


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
        self._table, self._lowest, self._highest = np.zeros((3, len(NUMBERS) + 9, num))
        self._start_progress, self._progress, self._best, self._best_tick = np.zeros((4, num))
        self._finish = np.zeros((num, 1))
        self._sums = np.zeros((2, num, world.num_modules))
        self._seen: Physics | None = None
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
        anything = (-np.inf,) * (len(NUMBERS) - 1)
        for row in rows:
            judge, episode = self._judges[row], self._episodes[row]
            aside, lowest = judge.find_limits()
            self._lowest[:, row] = *anything, ROLLED_OVER, -np.inf, -aside, lowest, *(-np.inf,) * 6
            self._highest[:, row] = np.inf
            self._highest[_MIN, row], self._highest[_MAX + 1, row] = judge.finish, aside
            self._highest[_IDLE:, row] = *late, fastest
            self._finish[row] = judge.finish
            self._start_progress[row] = self._progress[row] = self._best[row] = episode.progress
            self._best_tick[row] = self._table[_AGE, row] = 0.0
            self._watched.discard(row)
            start = self.describe_start(physics, row)
            self.numbers[:, row], self.flags[:, row] = start[: len(NUMBERS)], start[len(NUMBERS) :]

    def finish_ticks(self, physics: Physics, listens: np.ndarray) -> Ticks:
        """Judge and reward the tick whose physics has just been stepped.

        Args:
            physics: of all simulations.
            listens: `[N]` whether a simulation is one of those that were stepped.
        """
        if physics is not self._seen or not self.world.is_sliced:
            self._seen, self._views = physics, self._find_views(physics)
        with np.errstate(all="ignore"):  # what is not a number is looked at closely
            progress = self._measure(physics)
            is_quiet = (self._table >= self._lowest) & (self._table <= self._highest)
            is_special = np.logical_and.reduce(is_quiet, axis=0) < listens
            special = np.flatnonzero(is_special).tolist() if is_special.any() else []
            if self._watched:
                special = sorted(self._watched.union(special))
            closely = {row: self._look_closely(physics, row) for row in special if listens[row]}
            reward = self._pass_over(progress)
        np.copyto(self.numbers, self._table[: len(NUMBERS)], where=listens)
        ended = np.zeros((2, len(listens)), dtype=bool)
        ticks = Ticks(np.where(listens, reward, 0.0), *ended)
        for row, tick in closely.items():
            self._keep(row)
            ticks.reward[row], ticks.terminated[row], ticks.truncated[row] = tick[:3]
            self.numbers[:, row], self.flags[:, row] = tick.numbers, tick.flags
        return ticks

    def _find_views(self, physics: Physics) -> tuple[np.ndarray, ...]:
        """Return what is measured of the physics, as views that stay what they are while it goes on."""
        torque, rate = physics.actuator_force[:, self._servos], physics.qvel[:, self._dofs]
        return physics.position, physics.rotation[:, :, 8], physics.qvel, torque, rate

    def _measure(self, physics: Physics) -> np.ndarray:
        """Measure all; return progress."""
        places, up, rates, torque, rate = self._views
        if not self._is_plain:
            places = self._find_places(physics)
        table, sums, best, best_tick = self._table, self._sums, self._best, self._best_tick
        age = table[_AGE]
        np.minimum(places[:, :, 0], self._finish, out=sums[0])
        power = sums[1, :, : self._num_hinges]
        np.abs(np.multiply(torque, rate, out=power), out=power)
        total, work = np.add.accumulate(sums, axis=2)[:, :, -1]
        progress = total * self.judge.share
        np.multiply(work, self._weights[2], out=table[_EFFORT])
        table[_HEAD] = places[:, 0, 0]
        np.minimum.reduce(places, axis=1, out=table[_MIN : _MIN + 3].T)
        np.maximum.reduce(places, axis=1, out=table[_MAX : _MAX + 3].T)
        table[_LOWEST] = table[_MIN + 2]
        np.minimum.reduce(up, axis=1, out=table[_UPRIGHT])
        np.maximum.reduce(np.abs(rates), axis=1, out=table[_SPEED])
        age += 1.0
        has_moved = progress > best + STUCK_PROGRESS
        np.copyto(best, progress, where=has_moved)
        np.copyto(best_tick, age, where=has_moved)
        np.subtract(age, best_tick, out=table[_IDLE])
        return progress

    def _find_places(self, physics: Physics) -> np.ndarray:
        """Return how far along the route, how far left of its middle and how high each module is [m]."""
        places = physics.position.copy()
        for row, judge in enumerate(self._judges):
            places[row, :, 0], places[row, :, 1] = judge.find_places(physics.position[row])
        return places

    def _pass_over(self, progress: np.ndarray) -> np.ndarray:
        """Take the tick as an ordinary one everywhere; return rewards."""
        table = self._table
        forward = table[_FORWARD]
        np.subtract(progress, self._start_progress, out=table[_GAINED])
        np.multiply(table[_AGE], self._dt, out=table[_TIME])
        np.multiply(np.subtract(progress, self._progress, out=forward), self._weights[0], out=forward)
        self._progress = progress
        return forward + table[_EFFORT]

    def _look_closely(self, physics: Physics, row: int) -> Tick:
        episode = self._episodes[row]
        episode.progress, episode.best = float(self._progress[row]), float(self._best[row])
        episode.ticks, episode.best_tick = int(self._table[_AGE, row]) - 1, int(self._best_tick[row])
        return self._judge_row(physics, row)

    def _keep(self, row: int) -> None:
        """Take over what a close look came to."""
        episode = self._episodes[row]
        self._progress[row], self._best[row] = episode.progress, episode.best
        self._best_tick[row] = episode.best_tick
        (self._watched.add if episode.held else self._watched.discard)(row)
