"""A run of learning: what it may spend and has spent, and its judging from fresh starts."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np

STARTS, NEEDED = 50, 40
"""Fresh starts, and successes that count as solved: 80 %."""
FRESH_SEED = 10_000
"""Seeds of the fresh starts; learning uses smaller ones."""
PROMISING = 0.6
"""Share of successes while learning from which a policy is judged."""
Policy = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Budget:
    """What a run may spend.

    Attributes:
        robot_seconds: simulated time of all robots [s].
        minutes: processor time [min].
    """

    robot_seconds: float = 150_000.0
    minutes: float = 12.0


@dataclass
class Run:
    """A run of learning and what it has spent; `is_over` says whether to stop.

    Attributes:
        name: id of the environment.
        budget: what it may spend.
        robot_seconds: spent while learning [s].
        decisions: actions taken while learning.
        curve: (robot-seconds, share of successes while learning).
        judged: (robot-seconds, successes from fresh starts).
    """

    name: str
    budget: Budget
    robot_seconds: float = 0.0
    decisions: int = 0
    curve: list[tuple[int, float]] = field(default_factory=list)
    judged: list[tuple[int, int]] = field(default_factory=list)
    _began: float = field(default_factory=time.process_time)
    _judging: float = 0.0

    @property
    def minutes(self) -> float:
        """Processor time of learning [min]."""
        return (time.process_time() - self._began - self._judging) / 60

    @property
    def is_solved(self) -> bool:
        """Whether a policy succeeded often enough from fresh starts."""
        return bool(self.judged) and self.judged[-1][1] >= NEEDED

    @property
    def is_over(self) -> bool:
        """Whether learning has succeeded, or its budget is spent."""
        is_spent = self.robot_seconds >= self.budget.robot_seconds or self.minutes >= self.budget.minutes
        return self.is_solved or is_spent

    def note(self, share: float, make_policy: Callable[[int], Policy], **options: Any) -> None:
        """Note the share of successes while learning, and judge a promising policy from fresh starts."""
        self.curve.append((round(self.robot_seconds), round(share, 3)))
        if share >= PROMISING:
            began = time.process_time()
            self.judged.append((round(self.robot_seconds), judge(self.name, make_policy(STARTS), **options)))
            self._judging += time.process_time() - began

    def describe(self) -> dict[str, Any]:
        """Return the figures of the run."""
        return {
            "solved": self.is_solved,
            "successes": self.judged[-1][1] if self.judged else None,
            "starts": STARTS,
            "decisions": self.decisions,
            "robot_seconds": round(self.robot_seconds),
            "processor_minutes": round(self.minutes, 1),
            "budget": asdict(self.budget),
            "curve": self.curve[:: max(len(self.curve) // 60, 1)],
            "judged": self.judged,
        }


def judge(name: str, policy: Policy, **options: Any) -> int:
    """Return the number of successes of a policy from fresh starts."""
    envs: Any = gym.make_vec(
        name,
        num_envs=STARTS,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
        num_threads=1,
        **options,
    )
    observation, info = envs.reset(seed=FRESH_SEED)
    is_over = np.zeros(STARTS, dtype=bool)
    while not is_over.all():
        observation, _, terminated, truncated, info = envs.step(policy(observation))
        is_over |= terminated | truncated
    envs.close()
    return int(info["success"].sum())
