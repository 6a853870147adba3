"""Episodes of N simulations: commands in, verdicts and rewards out. Single and vector environment share it.

Every row is computed alike whatever N is, so that N simulations at once give the numbers of one to the bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from symbrion_gym.judge import SPEED_SLACK, STUCK_PROGRESS, Judge
from symbrion_gym.observation import Observer
from symbrion_gym.world import Physics, World


class Outcome(NamedTuple):
    """What a tick came to.

    Attributes:
        observation: `[N, O]`.
        reward: `[N]`.
        terminated: `[N]`.
        truncated: `[N]`.
        info: name -> `[N, ...]`.
    """

    observation: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    info: dict[str, Any]


class Episodes:
    """The memory of N episodes beside the physics.

    Attributes:
        target: `[N, h]` where the servos are told to go [rad].
        action: `[N, A]` the last action as it was used.
        ticks: `[N]` ticks since the start.
    """

    def __init__(self, world: World, num: int) -> None:
        self.world, self.num = world, num
        config, h = world.config, world.num_hinges
        self.num_tracks = {"constant": 0, "body": 1, "modules": world.num_modules}[config.track_control]
        self.num_actions = h + self.num_tracks
        self.judge = Judge(world)
        self.observer = Observer(world, self.num_actions)
        self.target = np.zeros((num, h))
        self.action = np.zeros((num, self.num_actions))
        self.ticks = np.zeros(num, dtype=np.int64)
        self.track_speed = np.full(num, config.track_speed)
        self._range = world.organism.scout.hinge_range
        self._largest_turn = world.organism.scout.hinge_speed * config.dt
        self._held = np.zeros(num, dtype=np.int64)
        self._start = np.zeros(num)
        self._start_head = np.zeros(num)
        self._start_progress = np.zeros(num)
        self._progress = np.zeros(num)
        self._best = np.zeros(num)
        self._best_tick = np.zeros(num, dtype=np.int64)
        self._last_tick = round(config.duration / config.dt)
        self._stuck_ticks = round(config.stuck_time / config.dt)

    def begin(self, rows: Any, physics: Physics, track_speed: Any) -> None:
        """Start episodes in the given rows (a slice, a mask or indices) from the present physics."""
        distance = self.judge.find_distance(physics.position)[rows]
        self.target[rows] = physics.qpos[rows][:, self.world.hinge_qpos]
        self.action[rows] = 0.0
        self.action[rows, : self.world.num_hinges] = np.clip(self.target[rows] / self._range, -1.0, 1.0)
        self.action[rows, self.world.num_hinges :] = 1.0
        self.ticks[rows] = 0
        self.track_speed[rows] = track_speed
        self._held[rows] = 0
        self._start[rows] = np.add.reduce(distance, axis=1) / distance.shape[1]
        self._start_head[rows] = distance[:, 0]
        progress = self._measure(distance)
        self._start_progress[rows] = progress
        self._progress[rows] = progress
        self._best[rows] = progress
        self._best_tick[rows] = 0

    def command(self, actions: np.ndarray) -> np.ndarray:
        """Take actions `[N, A]`: move the servos' targets, at their speed, and return them `[N, h]`.

        A number that is not one leaves its hinge where it was told to go before; others are clipped to ±1.
        """
        actions = np.where(actions == actions, actions, self.action)
        np.minimum(np.maximum(actions, -1.0, out=actions), 1.0, out=actions)
        self.action = actions
        turn = actions[:, : self.world.num_hinges] * self._range
        turn -= self.target
        np.minimum(np.maximum(turn, -self._largest_turn, out=turn), self._largest_turn, out=turn)
        self.target += turn
        return self.target

    def command_tracks(self) -> np.ndarray:
        """Return the speed of each module's tracks `[N, 1 or n]` [m/s]."""
        if not self.num_tracks:
            return self.track_speed[:, None]
        return self.track_speed[:, None] * self.action[:, self.world.num_hinges :]

    def observe(self, physics: Physics) -> np.ndarray:
        """Return noiseless observations `[N, O]`."""
        distance = self.judge.find_distance(physics.position)
        return self.observer.read(physics, self.action, self.target, distance[:, 0] - self._start_head)

    def finish_tick(self, physics: Physics, is_running: np.ndarray | None = None) -> Outcome:
        """Judge and reward the tick whose physics has just been stepped.

        Args:
            physics: the simulations.
            is_running: `[N]`; the others stand still, their time and their verdicts too. None: all run.
        """
        config, judge = self.world.config, self.judge
        diverged = judge.find_diverged(physics)
        if diverged.any():
            physics = Physics(*(np.where(_like(diverged, part), 0.0, part) for part in physics))
        self.ticks += 1 if is_running is None else is_running
        distance = judge.find_distance(physics.position)
        allowed = self._start + self.track_speed * (self.ticks * config.dt) + SPEED_SLACK
        held = self._held.copy()
        verdict = judge.judge(physics, distance, held, allowed, diverged)
        self._held = held if is_running is None else np.where(is_running, held, self._held)
        progress = np.where(diverged, self._progress, self._measure(distance))
        moved = progress > self._best + STUCK_PROGRESS
        self._best = np.where(moved, progress, self._best)
        self._best_tick = np.where(moved, self.ticks, self._best_tick)
        stuck = self.ticks - self._best_tick >= self._stuck_ticks
        late = self.ticks >= self._last_tick
        power = np.abs(
            physics.actuator_force[:, self.world.hinge_servos] * physics.qvel[:, self.world.hinge_dof]
        )
        reward_forward = config.forward_weight * (progress - self._progress)
        reward_effort = (-config.effort_weight * config.dt) * np.add.reduce(power, axis=1)
        reward_success = config.success_bonus * verdict.success
        self._progress = progress
        terminated = verdict.success | verdict.rolled_over | verdict.fell | verdict.touched_pit | diverged
        info = {
            "x_position": distance[:, 0],
            "progress": progress - self._start_progress,
            "success": verdict.success,
            "diverged": diverged,
            "rolled_over": verdict.rolled_over,
            "fell": verdict.fell,
            "touched_pit": verdict.touched_pit,
            "stuck": stuck,
            "time": self.ticks * config.dt,
            "reward_forward": reward_forward,
            "reward_success": reward_success,
            "reward_effort": reward_effort,
            "lowest_module": np.minimum.reduce(physics.position[:, :, 2], axis=1),
            "least_upright": np.minimum.reduce(physics.rotation[:, :, 8], axis=1),
        }
        observation = self.observer.read(physics, self.action, self.target, distance[:, 0] - self._start_head)
        reward = reward_forward + reward_success + reward_effort
        return Outcome(observation, reward, terminated, ~terminated & (stuck | late), info)

    def describe_start(self, physics: Physics) -> dict[str, Any]:
        """Return the info of a reset, name -> `[N, ...]`."""
        distance = self.judge.find_distance(physics.position)
        return {
            "x_position": distance[:, 0].copy(),
            "progress": np.zeros(self.num),
            "success": np.zeros(self.num, dtype=bool),
            "diverged": np.zeros(self.num, dtype=bool),
        }

    def _measure(self, distance: np.ndarray) -> np.ndarray:
        """Return the mean over the modules of how far each is, no farther than the finish, `[N]` [m]."""
        return np.add.reduce(np.minimum(distance, self.world.route.finish), axis=1) / distance.shape[1]


def _like(mask: np.ndarray, array: np.ndarray) -> np.ndarray:
    return mask.reshape(-1, *[1] * (array.ndim - 1))
