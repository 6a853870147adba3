"""Episodes of N simulations: commands in, verdicts and rewards out. Single and vector environment share it.

What is wide is done for all simulations at once; what is narrow, one by one in plain Python, which is faster
than small arrays. Every row comes out alike whatever N is, to the bit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from math import isnan
from operator import add
from typing import NamedTuple

import numpy as np

from symbrion_gym.environment.judge import ROLLED_OVER, SPEED_SLACK, Judge
from symbrion_gym.environment.observation import Observer
from symbrion_gym.environment.world import Physics, World, make_slice

STUCK_PROGRESS = 0.02
"""Progress that counts as moving on [m]."""
NUMBERS = (
    "x_position",
    "progress",
    "time",
    "reward_forward",
    "reward_success",
    "reward_effort",
    "lowest_module",
    "least_upright",
)
"""The numbers of `info`, in the order of `Tick.numbers`."""
FLAGS = ("success", "diverged", "rolled_over", "fell", "touched_pit", "stuck")
"""The flags of `info`, in the order of `Tick.flags`."""


class Tick(NamedTuple):
    """What a tick came to in one simulation."""

    reward: float
    terminated: bool
    truncated: bool
    numbers: tuple[float, ...]
    flags: tuple[bool, ...]


@dataclass(slots=True)
class Episode:
    """The memory of one episode beside the physics.

    Attributes:
        track_speed: [m/s].
        start: mean place of the modules at the start, along the route [m].
        start_progress: progress at the start [m].
        progress: progress at the last tick [m].
        best: progress at which the body last moved on [m].
        best_tick: when that was.
        ticks: since the start.
        held: ticks for which the body has arrived.
    """

    track_speed: float = 0.0
    start: float = 0.0
    start_progress: float = 0.0
    progress: float = 0.0
    best: float = 0.0
    best_tick: int = 0
    ticks: int = 0
    held: int = 0


class Episodes:
    """The memory of N episodes, and how a tick changes it.

    Attributes:
        target: `[N, h]` where the servos are told to go [rad].
        action: `[N, A]` the last action as it was used.
        num_tracks: how many numbers of an action are track speeds.
    """

    def __init__(self, world: World, num: int) -> None:
        self.world = world
        config, hinges = world.config, world.num_hinges
        self.num_tracks = {"constant": 0, "body": 1, "modules": world.num_modules}[config.track_control]
        self.num_actions = hinges + self.num_tracks
        self.judge = Judge(world)
        self.observer = Observer(world, self.num_actions)
        self.target = np.zeros((num, hinges))
        self.action = np.zeros((num, self.num_actions))
        self._judges = [self.judge] * num
        self._episodes = [Episode() for _ in range(num)]
        self._start_head = np.zeros(num)
        self._speed = np.zeros((num, 1))
        self._range = world.organism.scout.hinge_range
        self._largest_turn = world.organism.scout.hinge_speed * config.dt
        self._dt = config.dt
        self._num_hinges = hinges
        self._last_tick = round(config.duration / config.dt)
        self._stuck_ticks = round(config.stuck_time / config.dt)
        self._weights = (config.forward_weight, config.success_bonus, -config.effort_weight * config.dt)
        servos, dofs = world.hinge_servos, world.hinge_dof
        self._servos, self._dofs = make_slice(servos), make_slice(dofs)

    def begin(
        self,
        rows: Iterable[int],
        physics: Physics,
        track_speeds: Iterable[float],
        judges: Iterable[Judge] | None = None,
    ) -> None:
        """Start episodes in the given rows from the present physics.

        Args:
            rows: which simulations.
            physics: of all simulations.
            track_speeds: of these [m/s].
            judges: of these, where they live in other worlds than before.
        """
        hinges = self.world.num_hinges
        for row, judge in zip(rows, judges or (), strict=False):
            self._judges[row] = judge
        for row, speed in zip(rows, track_speeds, strict=True):
            self.target[row] = physics.qpos[row, self.world.hinge_qpos]
            self.action[row, :hinges] = np.clip(self.target[row] / self._range, -1.0, 1.0)
            self.action[row, hinges:] = 1.0
            measured = self._judges[row].measure(physics, row)
            start = measured.progress
            self._episodes[row] = Episode(speed, measured.mean, start, start, start)
            self._start_head[row] = measured.head
            self._speed[row] = speed

    def command(
        self, actions: np.ndarray, listens: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Take actions `[N, A]`: move the servos' targets at their speed.

        A number that is not one leaves what it commands as it was; the others are clipped to ±1.

        Args:
            actions: of all simulations.
            listens: `[N]` which simulations do; None for all.

        Returns:
            Targets `[N, h]` [rad] and track speeds `[N, 1 or n]` [m/s].
        """
        actions = np.minimum(np.maximum(actions, -1.0), 1.0)
        if isnan(np.add.reduce(actions, axis=None)):
            actions = np.where(np.isnan(actions), self.action, actions)
        if listens is not None:
            actions = np.where(listens[:, None], actions, self.action)
        self.action = actions
        turn = (actions[:, : self._num_hinges] if self.num_tracks else actions) * self._range
        turn -= self.target
        np.minimum(np.maximum(turn, -self._largest_turn, out=turn), self._largest_turn, out=turn)
        if listens is None:
            self.target += turn
        else:
            np.add(self.target, turn, out=self.target, where=listens[:, None])
        return self.target, self._speed * actions[:, -self.num_tracks :] if self.num_tracks else self._speed

    def observe(self, physics: Physics) -> np.ndarray:
        """Return noiseless observations `[N, O]`, within their bounds."""
        odometry = self._start_head
        if self.observer.has_odometry:
            odometry = self.judge.find_distance(physics.position)[:, 0] - odometry
        return self.observer.read(physics, self.action, self.target, odometry)

    def describe_start(self, physics: Physics, row: int) -> tuple[float | bool, ...]:
        """Return the numbers and flags of a reset in one row, in the order of `NUMBERS` and `FLAGS`."""
        measured = self._judges[row].measure(physics, row)
        place = (measured.lowest, measured.uprightness)
        return (measured.head, 0.0, 0.0, 0.0, 0.0, 0.0, *place, *(False for _ in FLAGS))

    def finish_tick(self, physics: Physics, rows: Iterable[int]) -> list[Tick]:
        """Judge and reward the tick whose physics has just been stepped, in the given rows."""
        return [self._judge_row(physics, row) for row in rows]

    def _judge_row(self, physics: Physics, row: int) -> Tick:
        episode, judge = self._episodes[row], self._judges[row]
        head, mean, rearmost, progress, aside, lowest, uprightness, is_sound = judge.measure(physics, row)
        episode.ticks += 1
        time = episode.ticks * self._dt
        rolled_over = fell = touched = False
        if is_sound:
            rolled_over, fell = uprightness < ROLLED_OVER, judge.is_off(aside, lowest)
            touched = judge.is_abyss and judge.has_touched_pit(physics, row)
        else:
            head, progress = episode.start, episode.progress
        has_failed = rolled_over or fell or touched or not is_sound
        allowed = episode.start + episode.track_speed * time + SPEED_SLACK
        has_arrived = rearmost > judge.finish and mean <= allowed and not has_failed
        episode.held = episode.held + 1 if has_arrived and judge.is_standing(physics, row) else 0
        success = episode.held >= judge.hold_ticks
        if progress > episode.best + STUCK_PROGRESS:
            episode.best, episode.best_tick = progress, episode.ticks
        stuck = episode.ticks - episode.best_tick >= self._stuck_ticks
        terminated = success or has_failed
        truncated = not terminated and (stuck or episode.ticks >= self._last_tick)
        forward_weight, success_bonus, effort_weight = self._weights
        forward = forward_weight * (progress - episode.progress)
        bonus = success_bonus if success else 0.0
        cost = effort_weight * self._find_power(physics, row) if is_sound else 0.0
        episode.progress = progress
        gained = progress - episode.start_progress
        return Tick(
            forward + bonus + cost,
            terminated,
            truncated,
            (head, gained, time, forward, bonus, cost, lowest, uprightness),
            (success, not is_sound, rolled_over, fell, touched, stuck),
        )

    def _find_power(self, physics: Physics, row: int) -> float:
        """Return the sum over the hinges of the absolute power [W]."""
        torques = physics.actuator_force[row, self._servos].tolist()
        rates = physics.qvel[row, self._dofs].tolist()
        return reduce(add, [abs(torque * rate) for torque, rate in zip(torques, rates, strict=True)], 0.0)
