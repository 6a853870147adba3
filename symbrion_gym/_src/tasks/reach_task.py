"""The task of reaching a place, several in turn, or a known object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from symbrion_gym._src.tasks.objects import ReachObject
from symbrion_gym._src.tasks.reach import ReachPlaces
from symbrion_gym._src.tasks.route import Point, StartName
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.usual_terms import UsualTerms


def make_reach(
    goal: Point | str | None = None,
    places: Sequence[Point] = (),
    distance: float | None = None,
    tolerance: float | None = None,
    start: StartName | Point = "floor",
    **terms: Any,
) -> Task:
    """Make the task of reaching a place, or several in turn, over drivable ground.

    Success: every place reached by the middle of the body within the tolerance, in turn; at the last one every module
    no farther from it than the straight body is long, upright, on the ground, the body no faster than its tracks, for
    0.3 s.
    """
    if isinstance(goal, str):
        target: ReachPlaces = ReachObject(tuple(places), distance, tolerance, goal)
    else:
        target = ReachPlaces((*places, *(() if goal is None else (goal,))), distance, tolerance)
    return UsualTerms(**terms).make_task("reach", Start(start), target)
