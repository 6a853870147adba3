"""The tasks that come with the package, by name."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, cast

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.tasks.goals import BeyondGap, FarEnd, OnTop, PassFinish
from symbrion_gym._src.tasks.reach import ReachObject, ReachPlaces
from symbrion_gym._src.tasks.route import Point, Start, StartName
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terms import Goal, Termination, TouchedPit, make_rewards, make_terminations

_LEAST_STEP = 0.02  # Smallest progress across a pit that counts as such [m]


@dataclass(frozen=True)
class UsualTerms:
    """Parameters of every task; they are parameters of the functions that make tasks, too."""

    # an episode is truncated after this [s]; 120 for "traverse"
    duration: float = 90.0
    # time without progress after which it is truncated as well [s]
    stuck_time: float = 15.0
    # smallest progress that counts as such [m]; None for a fifth of a module's length, in "snake_pit" for 0.02 m
    stuck_progress: float | None = None
    # reward per meter of progress
    forward_weight: float = 1.0
    success_bonus: float = 1.0  # reward of a success
    effort_weight: float = 0.002  # cost per joule of the hinges' work
    failure_cost: float = 1.0  # cost of a failure; what ends without success keeps none of the progress

    def make_task(self, name: str, start: Start, goal: Goal, **others: Termination) -> Task:
        """Return a task with these terms, and other terminations."""
        return Task(
            name=name,
            start=start,
            goal=goal,
            terminations=make_terminations(self.stuck_time, self.stuck_progress, **others),
            rewards=make_rewards(
                self.forward_weight, self.success_bonus, self.effort_weight, self.failure_cost
            ),
            duration=self.duration,
        )


def make_snake_pit(
    start: StartName | Point = "floor", goal: Point | None = None, bottomless: bool = False, **terms: Any
) -> Task:
    """Make the task of crossing a pit, or climbing stairs or a ramp, or reaching a place straight ahead."""
    usual = UsualTerms(**{"stuck_progress": _LEAST_STEP, **terms})
    touched = Termination("touched_pit", TouchedPit(bottomless))
    return usual.make_task("snake_pit", Start(start), PassFinish(goal), touched=touched)


def make_cross_gap(start: StartName | Point = "floor", bottomless: bool = False, **terms: Any) -> Task:
    """Make the task of crossing the first gap on the way across a surface.

    Success: every corner of every module beyond the far edge, upright, on the ground, the body no faster than its
    tracks, for 0.3 s.
    """
    touched = Termination("touched_pit", TouchedPit(bottomless))
    return UsualTerms(**terms).make_task("cross_gap", Start(start), BeyondGap(), touched=touched)


def make_climb(obstacle: str = "any", start: StartName | Point = "floor", **terms: Any) -> Task:
    """Make the task of climbing the first step, stairs or ramp on the way across a surface.

    Success: every corner of every module past the edge of the top, upright, on the ground, the body no faster than its
    tracks, for 0.3 s.
    """
    return UsualTerms(**terms).make_task("climb", Start(start), OnTop(obstacle=obstacle))


def make_traverse(
    share: float = 0.9, start: StartName | Point = "floor", goal: Point | None = None, **terms: Any
) -> Task:
    """Make the task of traversing the ground straight ahead as far as possible.

    Success: every corner of every module past a share of the way to the far end, upright, on the ground, the body no
    faster than its tracks, for 0.3 s.
    """
    usual = UsualTerms(**{"duration": 120.0, **terms})
    return usual.make_task("traverse", Start(start), FarEnd(goal, share=share))


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


TASKS: dict[str, Callable[..., Task]] = {
    "snake_pit": make_snake_pit,
    "cross_gap": make_cross_gap,
    "climb": make_climb,
    "reach": make_reach,
    "traverse": make_traverse,
}
"""Name -> function that makes the task of its parameters."""


def find_parameters(name: str) -> tuple[str, ...]:
    """Return the names of the parameters of a task."""
    check_choice("task", name, tuple(TASKS), TaskError)
    own = [each for each in inspect.signature(TASKS[name]).parameters if each != "terms"]
    return (*own, *(each.name for each in fields(UsualTerms)))


def make_task(name: str, **parameters: Any) -> Task:
    """Make a task of its name and parameters.

    Raises:
        TaskError: there is no such task, or a parameter is out of range.
        OptionError: it has no such parameter.
    """
    known = find_parameters(name)
    for each in parameters:
        check_choice(f"task {name!r}", each, known, OptionError)
    return TASKS[name](**parameters)


def choose_task(task: Task | str, parameters: Mapping[str, Any]) -> Task:
    """Return a task with parameters that were given beside it."""
    if isinstance(task, str):
        return make_task(task, **parameters)
    if not isinstance(task, Task):
        raise TaskError(f"task must be a Task or one of {', '.join(TASKS)}, got {task!r}")
    changes = dict(parameters)
    start = changes.pop("start", "floor")
    if not isinstance(start, str) or start == "pit":
        changes["start"] = Start(cast(Any, start))
    for name in changes:
        if name not in ("start", "duration"):
            raise OptionError(
                f"task {task.name!r} is a ready Task, so {name!r} cannot be given beside it; make it with the task"
            )
    return task.replace(**changes)
