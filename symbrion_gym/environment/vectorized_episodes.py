"""Episodes of many simulations: how a tick ended and its reward, as arrays over all simulations.

In most ticks of most simulations nothing ends and nothing arrives. Limits on a few measurements find those, and
array operations serve them all at once: the fast path. The others take the slow path, `Episodes.finish_tick`, one
by one. All numbers are the same on both, to the bit. This file is apart from `episodes.py` because the single
environment needs none of it: for one simulation, plain Python is faster than arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym.environment.episodes import FLAGS, NUMBERS, Episodes, Start, Tick
from symbrion_gym.environment.world import Physics, World

_HEAD, _GAINED, _TIME, _FORWARD, _, _EFFORT, _LOWEST, _ = range(len(NUMBERS))
_IDLE, _AGE, _RATE, _LEFT, _REAR, _RIGHT, _LOW, _UPRIGHT = range(8)
"""Rows of the measurements that have limits: ticks without progress, ticks, the fastest coordinate; of the modules the
position farthest left of the route's middle, least far along it, farthest right, lowest [m], and the least z of an up
axis."""
_NUM_UPPER = _RIGHT
"""The rows before this one have an upper limit, the others a lower one."""


class Ticks(NamedTuple):
    """How a tick ended in every simulation; nothing in those that stood still.

    Attributes:
        reward: reward of the tick.
        terminated: whether the episode ended by what happened.
        truncated: whether it ended by its time.
    """

    reward: Float[np.ndarray, " N"]
    terminated: Bool[np.ndarray, " N"]
    truncated: Bool[np.ndarray, " N"]


class VectorizedEpisodes(Episodes):
    """The memory of N episodes, as arrays.

    Attributes:
        numbers: `[len(NUMBERS), N]` numbers of `info` at the last tick or reset of each.
        flags: `[len(FLAGS), N]` likewise its flags.
    """

    def __init__(self, world: World, num: int) -> None:
        super().__init__(world, num)
        self.numbers = np.zeros((len(NUMBERS), num))
        self.flags = np.zeros((len(FLAGS), num), dtype=bool)
        self._table, self._measured, self._limits = np.zeros((3, 8, num))
        self._is_within = np.zeros((len(self._measured), num), dtype=bool)
        self._start_progress, self._progress, self._best, self._best_tick = np.zeros((4, num))
        self._finish = np.zeros(num)
        self._modules = np.zeros((world.num_modules, 4, num))
        self._rates = np.zeros((world.model.nv, num))
        self._power = np.zeros((self._num_hinges, num))
        self._array_source: Physics | None = None
        self._arrays: tuple[np.ndarray, ...] = ()
        self._is_along_x = True
        self._arrived: set[int] = set()

    def begin(self, physics: Physics, starts: Sequence[Start]) -> None:
        """Start episodes from the present physics; see `Episodes.begin`."""
        super().begin(physics, starts)
        latest = self._stuck_ticks - 0.5, self._last_tick - 0.5
        self._is_along_x = all(check.is_along_x for check in self._checks)
        for row, _, _ in starts:
            check, episode = self._checks[row], self._episodes[row]
            lateral, lowest = check.find_limits()
            max_rate, rolled_over = np.nextafter(check.criteria.max_rate, 0.0), check.criteria.rolled_over
            self._limits[:, row] = *latest, max_rate, lateral, check.finish, -lateral, lowest, rolled_over
            self._finish[row] = check.finish
            self._start_progress[row] = self._progress[row] = self._best[row] = episode.progress
            self._best_tick[row] = self._measured[_AGE, row] = 0.0
            self._arrived.discard(row)
            self._store_info(row, self.describe_start(physics, row))

    def finish_ticks(self, physics: Physics, active: Bool[np.ndarray, " N"]) -> Ticks:
        """Return how the tick ended whose physics has just been stepped, and its rewards.

        Args:
            physics: state of all simulations.
            active: whether a simulation is one of those that were stepped.
        """
        if physics is not self._array_source or not self._is_live:
            self._array_source, self._arrays = physics, self._find_arrays(physics)
        with np.errstate(all="ignore"):  # what is not a number takes the slow path
            progress = self._measure(physics)
            slow_rows = (self._find_fast() < active).nonzero()[0].tolist()
            if self._arrived:
                slow_rows = sorted(self._arrived.union(slow_rows))
            slow_ticks = {row: self._take_slow_path(physics, row) for row in slow_rows if active[row]}
            reward = self._take_fast_path(progress)
        np.copyto(self.numbers, self._table, where=active)
        ended = np.zeros((2, len(active)), dtype=bool)
        ticks = Ticks(np.where(active, reward, 0.0), *ended)
        for row, tick in slow_ticks.items():
            self._store_episode(row)
            ticks.reward[row], ticks.terminated[row], ticks.truncated[row], info = tick
            self._store_info(row, info)
        return ticks

    def _find_arrays(self, physics: Physics) -> tuple[np.ndarray, ...]:
        """Return what is measured of the physics, as views that stay valid while it goes on.

        Simulations come last, so that what is found among modules and hinges is found in all at once.
        """
        torque = physics.actuator_force[:, self._servos].T
        return physics.position.transpose(1, 2, 0), physics.rotation[:, :, 8].T, physics.qvel.T, torque

    def _measure(self, physics: Physics) -> Float[np.ndarray, " N"]:
        """Measure all; return progress [m]."""
        positions, up, rates, torque = self._arrays
        table, measured, best, best_tick = self._table, self._measured, self._best, self._best_tick
        modules, power, speeds, age = self._modules, self._power, self._rates, measured[_AGE]
        modules[:, :3] = positions if self._is_along_x else self._find_coordinates(physics)
        modules[:, 3] = up
        np.minimum.reduce(modules, axis=0, out=measured[_REAR:])
        np.maximum.reduce(modules[:, 1], axis=0, out=measured[_LEFT])
        table[_HEAD], table[_LOWEST:] = modules[0, 0], measured[_LOW:]
        np.abs(rates, speeds)
        np.maximum.reduce(speeds, axis=0, out=measured[_RATE])
        np.abs(np.multiply(torque, rates[self._dofs], power), power)
        np.multiply(_add_up(power), self._weights[2], table[_EFFORT])
        progress = _add_up(np.minimum(modules[:, 0], self._finish)) * self.check.share
        age += 1.0
        has_moved = progress > best + self._stuck_progress
        np.copyto(best, progress, where=has_moved)
        np.copyto(best_tick, age, where=has_moved)
        np.subtract(age, best_tick, measured[_IDLE])
        return progress

    def _find_fast(self) -> Bool[np.ndarray, " N"]:
        """Return which simulations keep to every limit, so that nothing has happened in them."""
        measured, limits, within, upper = self._measured, self._limits, self._is_within, _NUM_UPPER
        np.less_equal(measured[:upper], limits[:upper], within[:upper])
        np.greater_equal(measured[upper:], limits[upper:], within[upper:])
        return np.logical_and.reduce(within, axis=0)

    def _find_coordinates(self, physics: Physics) -> Float[np.ndarray, "n 3 N"]:
        """Return how far along the route, how far left of its middle and how high modules are [m]."""
        coordinates = physics.position.transpose(1, 2, 0).copy()
        for row, check in enumerate(self._checks):
            coordinates[:, 0, row], coordinates[:, 1, row] = check.find_coordinates(physics.position[row])
        return coordinates

    def _take_fast_path(self, progress: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Finish the tick everywhere as one in which nothing happened; return rewards."""
        table = self._table
        forward = table[_FORWARD]
        np.subtract(progress, self._start_progress, out=table[_GAINED])
        np.multiply(self._measured[_AGE], self._dt, out=table[_TIME])
        np.multiply(np.subtract(progress, self._progress, out=forward), self._weights[0], out=forward)
        self._progress = progress
        return forward + table[_EFFORT]

    def _store_info(self, row: int, info: dict[str, float | bool]) -> None:
        """Write the `info` of one simulation to the arrays."""
        values = tuple(info.values())
        self.numbers[:, row], self.flags[:, row] = values[: len(NUMBERS)], values[len(NUMBERS) :]

    def _take_slow_path(self, physics: Physics, row: int) -> Tick:
        """Finish the tick of one simulation as the single environment does."""
        episode = self._episodes[row]
        episode.progress, episode.best = float(self._progress[row]), float(self._best[row])
        episode.ticks, episode.best_tick = int(self._measured[_AGE, row]) - 1, int(self._best_tick[row])
        return self.finish_tick(physics, row)

    def _store_episode(self, row: int) -> None:
        """Write what the slow path changed to the arrays."""
        episode = self._episodes[row]
        self._progress[row], self._best[row] = episode.progress, episode.best
        self._best_tick[row] = episode.best_tick
        (self._arrived.add if episode.held else self._arrived.discard)(row)


def _add_up(values: Float[np.ndarray, "n N"]) -> Float[np.ndarray, " N"]:
    """Return the sums of values, added one after the other as in plain Python."""
    return np.add.accumulate(values, axis=0)[-1] if len(values) else np.zeros(values.shape[1])
