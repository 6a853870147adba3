"""The task of `SnakePit-v1` and its siblings: get a snake across."""

from __future__ import annotations

from symbrion_gym._src.tasks.criteria import SuccessCriteria
from symbrion_gym._src.tasks.features.gap import GapSearch
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.rewards import (
    gain_potential,
    gain_progress,
    has_failed,
    has_succeeded,
    spend_power,
)
from symbrion_gym._src.tasks.route import Point, RouteMargins, StartName
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terminations import FellOff, RolledOver, Stuck, TouchedPit
from symbrion_gym._src.tasks.terms import Reward, Termination


def make_snake_pit(
    start: StartName | Point = "floor",
    goal: Point | None = None,
    bottomless: bool = False,
    duration: float = 90.0,
    stuck_time: float = 15.0,
    stuck_progress: float = 0.02,
    forward_weight: float = 1.0,
    success_bonus: float = 1.0,
    effort_weight: float = 0.002,
    failure_cost: float | None = None,
    criteria: SuccessCriteria | None = None,
    margins: RouteMargins | None = None,
    pit_search: GapSearch | None = None,
) -> Task:
    """Make the task of crossing a pit, or climbing stairs or a ramp, or reaching a place straight ahead."""
    gain = gain_progress if failure_cost is None else gain_potential
    failure = () if failure_cost is None else (Reward("failure", has_failed, -failure_cost, at_end=True),)
    return Task(
        name="snake_pit",
        start=Start(start),
        goal=PassFinish(goal, margins, pit_search),
        terminations=(
            Termination("rolled_over", RolledOver()),
            Termination("fell", FellOff()),
            Termination("touched_pit", TouchedPit(bottomless)),
            Termination("stuck", Stuck(stuck_time, stuck_progress), truncates=True),
        ),
        rewards=(
            Reward("forward", gain, forward_weight),
            Reward("success", has_succeeded, success_bonus, at_end=True),
            *failure,
            Reward("effort", spend_power, -effort_weight, per_second=True),
        ),
        duration=duration,
        criteria=criteria,
    )
