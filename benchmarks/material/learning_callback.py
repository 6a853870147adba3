"""Watches a run of stable-baselines3: what it spent, how often it succeeds, when to stop."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

if TYPE_CHECKING:
    from benchmarks.material.learning_run import Policy, Run

_NOTED_EVERY = 4096
"""Decisions between two points of the curve."""


class Watcher(BaseCallback):
    """Count decisions and robot-seconds, note the share of successes, and stop a run that is over.

    Args:
        run: the run.
        envs: its environments, which normalize observations.
        seconds: length of a decision [s].
        recent: episodes of which the share of successes is taken.
        frame_skip: physics steps of a decision.
    """

    def __init__(self, run: Run, envs: Any, seconds: float, recent: int, frame_skip: int) -> None:
        super().__init__()
        self._run, self._envs, self._seconds, self._frame_skip = run, envs, seconds, frame_skip
        self._successes: deque[bool] = deque(maxlen=recent)
        self._recent, self._next = recent, _NOTED_EVERY

    def _on_step(self) -> bool:
        run = self._run
        run.decisions = self.num_timesteps
        run.robot_seconds = self.num_timesteps * self._seconds
        self._successes.extend(bool(info["is_success"]) for info in self.locals["infos"] if "episode" in info)
        if self.num_timesteps < self._next:
            return True
        self._next += _NOTED_EVERY
        share = sum(self._successes) / self._recent
        run.note(share, lambda count: self._make_policy(), frame_skip=self._frame_skip)
        return not run.is_over

    def _make_policy(self) -> Policy:
        """Return the deterministic policy of this moment."""
        normalize, model = self._envs.normalize_obs, self.model

        def act(observation: np.ndarray) -> np.ndarray:
            return model.predict(normalize(observation), deterministic=True)[0]

        return act
