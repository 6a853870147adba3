"""The tasks that come with the package, by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, cast

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.explore import make_explore
from symbrion_gym._src.tasks.features import GapSearch, Way, find_gap, find_ramp, find_stairs, find_step
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.objects import ReachObject
from symbrion_gym._src.tasks.reach import ReachPlaces
from symbrion_gym._src.tasks.route import Point, Route, RouteMargins, StartName, SuccessCriteria
from symbrion_gym._src.tasks.starts import Start, make_route
from symbrion_gym._src.tasks.task import (
    Task,
    gain_potential,
    gain_progress,
    has_failed,
    has_succeeded,
    spend_power,
)
from symbrion_gym._src.tasks.terminations import FellOff, RolledOver, Stuck, TouchedPit, make_terminations
from symbrion_gym._src.tasks.terms import Reward, Termination
from symbrion_gym._src.tasks.traverse import UsualTerms, make_dock, make_recover, make_traverse


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


@dataclass(frozen=True)
class BeyondGap(PassFinish):
    """Get every module across the first gap on the way."""

    search: GapSearch | None = None  # what counts as a gap; None for the defaults

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the gap on the surface alone."""
        gap = find_gap(arena, organism, None, self.search)
        pit = gap.near, gap.far, gap.floor
        finish = gap.find_finish(organism)
        return make_route(arena, organism, gap.way, start, gap.start, finish, pit, self.margins)


def make_cross_gap(
    start: StartName | Point = "floor",
    bottomless: bool = False,
    search: GapSearch | None = None,
    **terms: Any,
) -> Task:
    """Make the task of crossing the first gap on the way across a surface.

    Success: every corner of every module beyond the far edge, upright, on the ground, the body no faster than its
    tracks, for 0.3 s.
    """
    usual = UsualTerms(**terms)
    touched = Termination("touched_pit", TouchedPit(bottomless))
    terminations = make_terminations(usual.stuck_time, usual.stuck_progress, touched=touched)
    return usual.make_task("cross_gap", Start(start), BeyondGap(search=search), terminations)


OBSTACLES = ("stairs", "step", "ramp")


@dataclass(frozen=True)
class OnTop(PassFinish):
    """Get every module past the top of a step, of stairs or of a ramp.

    Raises:
        TaskError: there is no such kind.
    """

    obstacle: str = "any"  # "stairs", "step" or "ramp"; "any" for the first kind that is there, in this order

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("obstacle", self.obstacle, ("any", *OBSTACLES), TaskError)

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find what to climb on the surface alone."""
        kinds = OBSTACLES if self.obstacle == "any" else (self.obstacle,)
        for kind in kinds[:-1]:
            try:
                way, foot, top = _find(kind, arena, organism)
                break
            except TaskError:
                continue
        else:
            way, foot, top = _find(kinds[-1], arena, organism)
        return make_route(
            arena, organism, way, start, foot, top + organism.scout.pitch / 2, margins=self.margins
        )


def _find(kind: str, arena: Arena, organism: Organism) -> tuple[Way, float, float]:
    """Return the way, the foot and the top of an obstacle [m]."""
    if kind == "stairs":
        stairs = find_stairs(arena, organism)
        return stairs.way, stairs.steps[0].edge, stairs.steps[-1].edge
    if kind == "step":
        step = find_step(arena, organism)
        return step.way, step.edge, step.edge
    ramp = find_ramp(arena)
    return ramp.way, ramp.foot, ramp.crest


def make_climb(obstacle: str = "any", start: StartName | Point = "floor", **terms: Any) -> Task:
    """Make the task of climbing the first step, stairs or ramp on the way across a surface.

    Success: every corner of every module past the edge of the top, upright, on the ground, the body no faster than its
    tracks, for 0.3 s.
    """
    return UsualTerms(**terms).make_task("climb", Start(start), OnTop(obstacle=obstacle))


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


TASKS: dict[str, Callable[..., Task]] = {
    "snake_pit": make_snake_pit,
    "cross_gap": make_cross_gap,
    "climb": make_climb,
    "reach": make_reach,
    "dock": make_dock,
    "traverse": make_traverse,
    "explore": make_explore,
    "recover": make_recover,
}
"""Name -> function that makes the task of its parameters."""


def find_parameters(name: str) -> tuple[str, ...]:
    """Return the names of the parameters of a task."""
    if name not in TASKS:
        raise TaskError(f"no task {name!r}; there are: {', '.join(TASKS)}")
    parameters = inspect.signature(TASKS[name]).parameters.values()
    own = tuple(each.name for each in parameters if each.kind is not inspect.Parameter.VAR_KEYWORD)
    return own if len(own) == len(parameters) else (*own, *(each.name for each in fields(UsualTerms)))


def make_task(name: str, **parameters: Any) -> Task:
    """Make a task of its name and parameters.

    Raises:
        TaskError: there is no such task, or a parameter is out of range.
        OptionError: it has no such parameter.
    """
    known = find_parameters(name)
    for each in parameters:
        if each not in known:
            raise OptionError(f"task {name!r} has no parameter {each!r}; there are: {', '.join(known)}")
    return TASKS[name](**parameters)


def choose_task(task: Task | str, parameters: Mapping[str, Any]) -> Task:
    """Return a task with parameters that were given beside it."""
    if isinstance(task, str):
        return make_task(task, **parameters)
    if not isinstance(task, Task):
        raise TaskError(f"task must be a Task or one of {', '.join(TASKS)}, got {task!r}")
    changes = dict(parameters)
    start = changes.pop("start", "floor")
    if not isinstance(start, str):
        changes["start"] = Start(cast(Any, start), task.start.roll)
    elif start == "pit":
        changes["start"] = Start("pit", roll=task.start.roll)
    for name in changes:
        if name not in ("start", "duration"):
            raise OptionError(
                f"task {task.name!r} is a ready Task, so {name!r} cannot be given beside it; make it with the task"
            )
    return task.replace(**changes)
