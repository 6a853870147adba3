"""What tasks have in common: their time, their rewards and what ends them, each with a usual value."""

from __future__ import annotations

from dataclasses import dataclass

from symbrion_gym._src.tasks.criteria import SuccessCriteria
from symbrion_gym._src.tasks.rewards import make_rewards
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terminations import make_terminations
from symbrion_gym._src.tasks.terms import Goal, Termination


@dataclass(frozen=True)
class UsualTerms:
    """Parameters of every task but "snake_pit"; they are parameters of the functions that make tasks, too.

    Attributes:
        duration: an episode is truncated after this [s]; 180 for "explore", 120 for "traverse", 30 for "recover".
        stuck_time: time without progress after which it is truncated as well [s]; 20 for "explore".
        stuck_progress: smallest progress that counts as such, in the unit of the goal; None for a fifth of a module's
            length, in "recover" for a change of the mean uprightness by 0.05.
        forward_weight: reward per unit of progress: a meter, a square meter seen, or of uprightness, of which there are
            two.
        success_bonus: reward of a success.
        effort_weight: cost per joule of the hinges' work.
        failure_cost: cost of a failure, which keeps none of the progress either.
        criteria: limits of a success; None for those of the body.
    """

    duration: float = 90.0
    stuck_time: float = 15.0
    stuck_progress: float | None = None
    forward_weight: float = 1.0
    success_bonus: float = 1.0
    effort_weight: float = 0.002
    failure_cost: float = 1.0
    criteria: SuccessCriteria | None = None

    def make_task(
        self, name: str, start: Start, goal: Goal, terminations: tuple[Termination, ...] | None = None
    ) -> Task:
        """Return a task with these terms."""
        rewards = make_rewards(self.forward_weight, self.success_bonus, self.effort_weight, self.failure_cost)
        return Task(
            name=name,
            start=start,
            goal=goal,
            terminations=make_terminations(self.stuck_time, self.stuck_progress)
            if terminations is None
            else terminations,
            rewards=rewards,
            duration=self.duration,
            criteria=self.criteria,
        )
