"""The task of reaching a place, several in turn, or a known object."""

from __future__ import annotations

from collections.abc import Sequence

from symbrion_gym.tasks.criteria import SuccessCriteria
from symbrion_gym.tasks.objects import ReachObject
from symbrion_gym.tasks.reach import ReachPlaces
from symbrion_gym.tasks.rewards import make_rewards
from symbrion_gym.tasks.route import Point, StartName
from symbrion_gym.tasks.starts import Start
from symbrion_gym.tasks.task import Task
from symbrion_gym.tasks.terminations import make_terminations


def make_reach(
    goal: Point | str | None = None,
    places: Sequence[Point] = (),
    distance: float | None = None,
    tolerance: float | None = None,
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
    """Make the task of reaching a place, or several in turn, over drivable ground.

    Success: every place reached by the middle of the body within the tolerance, in turn; at the last one every module
    no farther from it than the straight body is long, upright, on the ground, the body no faster than its tracks, for
    0.3 s.

    Args:
        goal: (x, y) or (x, y, z) of the place [m]; None to choose it on the map; or a known object of the arena, by
            the name of its site, as "object_socket_0": the head ends within a body length of its front, turned to it.
        places: way-points before it, or in its place.
        distance: length of the path to a place that is chosen [m]; None for as far as possible, up to 10 m.
        tolerance: distance of the middle from a place that has been reached [m]; None for the length of a module.
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
    if isinstance(goal, str):
        target: ReachPlaces = ReachObject(tuple(places), distance, tolerance, goal)
    else:
        target = ReachPlaces((*places, *(() if goal is None else (goal,))), distance, tolerance)
    return Task(
        name="reach",
        start=Start(start),
        goal=target,
        terminations=make_terminations(stuck_time, stuck_progress),
        rewards=make_rewards(forward_weight, success_bonus, effort_weight, failure_cost),
        duration=duration,
        criteria=criteria,
    )
