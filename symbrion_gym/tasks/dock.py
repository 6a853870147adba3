"""The task of docking at a known object, as a docking station or a power socket."""

from __future__ import annotations

import numpy as np

from symbrion_gym.tasks.criteria import SuccessCriteria
from symbrion_gym.tasks.objects import DockAtObject
from symbrion_gym.tasks.rewards import make_rewards
from symbrion_gym.tasks.route import Point, StartName
from symbrion_gym.tasks.starts import Start
from symbrion_gym.tasks.task import Task
from symbrion_gym.tasks.terminations import make_terminations


def make_dock(
    goal: str = "station",
    tolerance: float = 0.03,
    max_angle: float = float(np.deg2rad(10.0)),
    start: StartName | Point = "floor",
    duration: float = 90.0,
    stuck_time: float = 15.0,
    stuck_progress: float | None = None,
    forward_weight: float = 1.0,
    success_bonus: float = 1.0,
    effort_weight: float = 0.002,
    failure_cost: float = 1.0,
    criteria: SuccessCriteria | None = None,
) -> Task:
    """Make the task of docking at a known object with the front dock of the head.

    Success: the dock within the tolerance of the middle of the object's front, ahead and to the side, the head aligned
    with it, every module upright, on the ground, the body no faster than its tracks, for 0.3 s.

    Args:
        goal: the object: name of its site in the arena, as "object_station_0", or of its kind where there is one.
        tolerance: distance of the dock from the middle of the front, ahead and to the side [m].
        max_angle: largest angle between the head and the front [rad].
        start: "floor": a place of the map with room around it; or (x, y) of the head [m].
        duration: an episode is truncated after this [s].
        stuck_time: time without progress after which it is truncated as well [s].
        stuck_progress: smallest progress that counts as such [m]; None for a fifth of a module.
        forward_weight: reward per meter of progress.
        success_bonus: reward of a success.
        effort_weight: cost per joule of the hinges' work.
        failure_cost: cost of a failure, which keeps none of the progress either.
        criteria: limits of a success; None for those of the body.
    """
    return Task(
        name="dock",
        start=Start(start),
        goal=DockAtObject(tolerance=tolerance, site=goal, max_angle=max_angle),
        terminations=make_terminations(stuck_time, stuck_progress),
        rewards=make_rewards(forward_weight, success_bonus, effort_weight, failure_cost),
        duration=duration,
        criteria=criteria,
    )
