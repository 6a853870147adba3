"""Many episodes judged at once: the ordinary ticks as arrays, those in which something happens one by one.

Most ticks of most simulations end nothing and arrive nowhere. Limits on what is measured tell which do not;
those go the way of the single environment. All numbers are the same as there, to the bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from symbrion_gym.environment.episodes import FLAGS, NUMBERS, STUCK_PROGRESS, Episodes, Tick
from symbrion_gym.environment.judge import LARGEST_SPEED, ROLLED_OVER, Judge
from symbrion_gym.environment.world import Physics, World


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
        self._fresh = np.zeros((len(NUMBERS), num))
        self._start_progress, self._progress, self._best, self._best_tick, self._ticks = np.zeros((5, num))
        self._finish = np.zeros((num, 1))
        self._sums = np.zeros((3, num, world.num_modules))
        self._measured, self._limits = np.zeros((2, 7, num))
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
        for row in rows:
            judge, episode = self._judges[row], self._episodes[row]
            aside, lowest = judge.find_limits()
            self._limits[:, row] = -ROLLED_OVER, aside, -lowest, judge.finish, *late, fastest
            self._finish[row] = judge.finish
            self._start_progress[row] = self._progress[row] = self._best[row] = episode.progress
            self._best_tick[row] = self._ticks[row] = 0.0
            self._watched.discard(row)
            start = self.describe_start(physics, row)
            self.numbers[:, row], self.flags[:, row] = start[: len(NUMBERS)], start[len(NUMBERS) :]

    def finish_ticks(self, physics: Physics, rows: Sequence[int]) -> Ticks:
        """Judge and reward the tick whose physics has just been stepped, in the given rows."""
        is_listed = np.zeros(len(self._episodes), dtype=bool)
        is_listed[rows] = True
        with np.errstate(all="ignore"):  # what is not a number is looked at closely
            progress, is_ordinary = self._measure(physics)
            special = self._watched.union(np.flatnonzero(is_ordinary < is_listed).tolist())
            closely = {row: self._look_closely(physics, row) for row in sorted(special.intersection(rows))}
            reward = self._pass_over(progress)
        np.copyto(self.numbers, self._fresh, where=is_listed)
        self.flags[:, rows] = False
        ticks = Ticks(np.where(is_listed, reward, 0.0), *np.zeros((2, len(self._episodes)), dtype=bool))
        for row, tick in closely.items():
            self._keep(row)
            ticks.reward[row], ticks.terminated[row], ticks.truncated[row] = tick[:3]
            self.numbers[:, row], self.flags[:, row] = tick.numbers, tick.flags
        return ticks

    def _measure(self, physics: Physics) -> tuple[np.ndarray, np.ndarray]:
        """Measure all; return progress and whether nothing can have happened."""
        head, _, _, _, _, cost, lowest, upright = self._fresh
        tilt, aside, depth, rearmost, idle, age, speed = self._measured
        along, across = self._find_places(physics)
        sums, hinges = self._sums, self._num_hinges
        head[:] = along[:, 0]
        sums[0] = along
        np.minimum(along, self._finish, out=sums[1])
        torque, rate = physics.actuator_force[:, self._servos], physics.qvel[:, self._dofs]
        np.abs(np.multiply(torque, rate, out=sums[2, :, :hinges]), out=sums[2, :, :hinges])
        _, progress, power = np.add.accumulate(sums, axis=2)[:, :, -1]
        progress *= self.judge.share
        np.multiply(power, self._weights[2], out=cost)
        np.minimum.reduce(physics.position[:, :, 2], axis=1, out=lowest)
        np.minimum.reduce(physics.rotation[:, :, 8], axis=1, out=upright)
        np.negative(upright, out=tilt)
        np.negative(lowest, out=depth)
        np.maximum.reduce(np.abs(across), axis=1, out=aside)
        np.minimum.reduce(along, axis=1, out=rearmost)
        np.maximum.reduce(np.abs(physics.qvel), axis=1, out=speed)
        np.add(self._ticks, 1.0, out=age)
        has_moved = progress > self._best + STUCK_PROGRESS
        np.subtract(age, np.where(has_moved, age, self._best_tick), out=idle)
        return progress, np.logical_and.reduce(self._measured <= self._limits, axis=0)

    def _find_places(self, physics: Physics) -> tuple[np.ndarray, np.ndarray]:
        """Return how far along the route and how far from its middle each module is, `[N, n]` each [m]."""
        position = physics.position
        if all(judge is self._judges[0] or judge.is_plain for judge in self._judges):
            return self._judges[0].find_places(position)
        places = [judge.find_places(position[[row]]) for row, judge in enumerate(self._judges)]
        return np.concatenate([along for along, _ in places]), np.concatenate([aside for _, aside in places])

    def _pass_over(self, progress: np.ndarray) -> np.ndarray:
        """Take the tick as an ordinary one everywhere; return rewards."""
        _, gained, time, forward, _, cost, _, _ = self._fresh
        idle, age = self._measured[4:6]
        np.subtract(progress, self._start_progress, out=gained)
        np.multiply(age, self._dt, out=time)
        np.multiply(np.subtract(progress, self._progress, out=forward), self._weights[0], out=forward)
        np.copyto(self._best, progress, where=idle == 0.0)
        np.subtract(age, idle, out=self._best_tick)
        self._progress, self._ticks[:] = progress, age
        return forward + cost

    def _look_closely(self, physics: Physics, row: int) -> Tick:
        episode = self._episodes[row]
        episode.progress, episode.best = float(self._progress[row]), float(self._best[row])
        episode.ticks, episode.best_tick = int(self._ticks[row]), int(self._best_tick[row])
        return self._judge_row(physics, row)

    def _keep(self, row: int) -> None:
        """Take over what a close look came to."""
        episode = self._episodes[row]
        self._progress[row], self._best[row] = episode.progress, episode.best
        self._ticks[row], self._best_tick[row] = episode.ticks, episode.best_tick
        (self._watched.add if episode.held else self._watched.discard)(row)
