"""The task of traversing rough ground as far as possible."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import PassFinish, find_honest, find_standing
from symbrion_gym._src.tasks.objects import DockAtObject
from symbrion_gym._src.tasks.paths import find_path
from symbrion_gym._src.tasks.route import Point, Route, StartName, SuccessCriteria, find_route
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.state import TaskState, add_up
from symbrion_gym._src.tasks.task import Task, make_rewards
from symbrion_gym._src.tasks.terminations import FellOff, Stuck, make_terminations
from symbrion_gym._src.tasks.terms import Goal, Termination


@dataclass(frozen=True)
class UsualTerms:
    """Parameters of every task but "snake_pit"; they are parameters of the functions that make tasks, too."""

    # an episode is truncated after this [s]; 180 for "explore", 120 for "traverse", 30 for "recover"
    duration: float = 90.0
    # time without progress after which it is truncated as well [s]; 20 for "explore"
    stuck_time: float = 15.0
    # smallest progress that counts as such, in the unit of the goal; None for a fifth of a module's length,
    # in "recover" for a change of the mean uprightness by 0.05
    stuck_progress: float | None = None
    # reward per unit of progress: a meter, a square meter seen, or of uprightness, of which there are two
    forward_weight: float = 1.0
    success_bonus: float = 1.0  # reward of a success
    effort_weight: float = 0.002  # cost per joule of the hinges' work
    failure_cost: float = 1.0  # cost of a failure, which keeps none of the progress either
    criteria: SuccessCriteria | None = None  # limits of a success; None for those of the body

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


_SAMPLES = 0.02  # Spacing of the heights along the way [m]
_CLIMB = 1.2  # A body rears up or lowers itself over walls of this share of a module's height at most


@dataclass(frozen=True)
class FarEnd(PassFinish):
    """Get every module to the far end of the ground straight ahead: to its rim, or to a wall or drop on it.

    Raises:
        TaskError: the share is not above 0 and up to 1.
    """

    share: float = 0.9  # share of the way to the far end that has to be traversed

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.share <= 1.0:
            raise TaskError(f"share must be above 0, up to 1, got {self.share!r}")

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the straight way over the ground and where it ends."""
        bare = replace(arena, course=None)
        route = find_route(bare, organism, start.place, self.place, self.margins, self.pit_search)
        tail = -min(pose.x for pose in organism.compute_poses())
        if self.place is not None:
            return replace(route, finish=route.finish, pit=None)
        reach = float(np.linalg.norm(np.ptp(np.asarray(arena.surface.bounds), axis=0)[:2]))
        s = np.arange(route.start, route.start + reach, _SAMPLES)
        heights = bare.height(*route.place(s))
        wall = _CLIMB * organism.scout.size[2]
        ends = np.flatnonzero(~np.isfinite(heights[1:]) | (np.abs(np.diff(heights)) > wall))
        end = s[ends[0]] if len(ends) else s[-1]
        room = end - organism.scout.arm_reach - tail - route.start
        return replace(route, finish=float(route.start - tail + self.share * max(room + tail, 0.0)), pit=None)


def make_traverse(
    share: float = 0.9, start: StartName | Point = "floor", goal: Point | None = None, **terms: Any
) -> Task:
    """Make the task of traversing the ground straight ahead as far as possible.

    Success: every corner of every module past a share of the way to the far end, upright, on the ground, the body no
    faster than its tracks, for 0.3 s.
    """
    usual = UsualTerms(**{"duration": 120.0, **terms})
    return usual.make_task("traverse", Start(start), FarEnd(goal, share=share))


_RIGHTING = 0.05  # Change of the mean uprightness that counts as progress


@dataclass(frozen=True)
class StandUp:
    """Get every module upright and on the ground."""

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find a place on the map with room around it, unless the start is a place."""
        return find_path(arena, organism, start, ())

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the mean z of the modules' up axes, from -1 to 1."""
        return add_up(state.up) * (1.0 / state.up.shape[1])

    def distance_to_goal(self, state: TaskState) -> Float[Any, " N"]:
        """Return by how much the modules lean, from 0 to 2."""
        return 1.0 - state.progress

    def limits(self, state: TaskState) -> dict[str, float]:
        """Return the limits within which no body stands."""
        return {"progress": state.criteria.upright}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether every module is upright and on the ground."""
        has_arrived = (state.least_up > state.criteria.upright) & find_honest(state)
        return state.confirm(has_arrived, lambda rows: find_standing(state, rows))


def make_recover(
    least: float = 2.0, most: float = np.pi, start: StartName | Point = "floor", **terms: Any
) -> Task:
    """Make the task of standing up after a tumble.

    Success: every module upright and on the ground, the body no farther from where it started than its tracks can have
    taken it, for 0.3 s.
    """
    usual = UsualTerms(**{"duration": 30.0, "stuck_progress": _RIGHTING, **terms})
    fell = Termination("fell", FellOff())
    stuck = Termination("stuck", Stuck(usual.stuck_time, usual.stuck_progress), truncates=True)
    return usual.make_task("recover", Start(start, (least, most)), StandUp(), (fell, stuck))


def make_dock(
    goal: str = "station",
    tolerance: float = 0.03,
    max_angle: float = float(np.deg2rad(10.0)),
    start: StartName | Point = "floor",
    **terms: Any,
) -> Task:
    """Make the task of docking at a known object with the front dock of the head.

    Success: the dock within the tolerance of the middle of the object's front, ahead and to the side, the head aligned
    with it, every module upright, on the ground, the body no faster than its tracks, for 0.3 s.
    """
    target = DockAtObject(tolerance=tolerance, site=goal, max_angle=max_angle)
    return UsualTerms(**terms).make_task("dock", Start(start), target)
