"""The task of crossing a gap."""

from __future__ import annotations

from dataclasses import dataclass

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.robot.organism import Organism
from symbrion_gym.tasks.criteria import SuccessCriteria
from symbrion_gym.tasks.features import GapSearch, find_gap
from symbrion_gym.tasks.goals import PassFinish
from symbrion_gym.tasks.rewards import make_rewards
from symbrion_gym.tasks.route import Point, Route, StartName
from symbrion_gym.tasks.starts import Start
from symbrion_gym.tasks.task import Task
from symbrion_gym.tasks.terminations import TouchedPit, make_terminations
from symbrion_gym.tasks.terms import Termination
from symbrion_gym.tasks.ways import make_route


@dataclass(frozen=True)
class BeyondGap(PassFinish):
    """Get every module across the first gap on the way.

    Attributes:
        search: what counts as a gap; None for the defaults.
    """

    search: GapSearch | None = None

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the gap on the surface alone.

        Raises:
            TaskError: there is none; the message gives the reason.
            ArenaError: there is no room at the start.
        """
        gap = find_gap(arena, organism, None, self.search)
        pit = gap.near, gap.far, gap.floor
        finish = gap.find_finish(organism)
        return make_route(arena, organism, gap.way, start, gap.start, finish, pit, self.margins)


def make_cross_gap(
    start: StartName | Point = "floor",
    bottomless: bool = False,
    duration: float = 90.0,
    stuck_time: float = 15.0,
    stuck_progress: float | None = None,
    forward_weight: float = 1.0,
    success_bonus: float = 1.0,
    effort_weight: float = 0.002,
    failure_cost: float = 1.0,
    criteria: SuccessCriteria | None = None,
    search: GapSearch | None = None,
) -> Task:
    """Make the task of crossing the first gap on the way across a surface.

    Success: every corner of every module beyond the far edge, upright, on the ground, the body no faster than its
    tracks, for 0.3 s.

    Args:
        start: "floor": before the ramp; "pit": before the gap; or (x, y) [m].
        bottomless: whether touching the floor of the gap is a failure.
        duration: an episode is truncated after this [s].
        stuck_time: time without progress after which it is truncated as well [s].
        stuck_progress: smallest progress that counts as such [m]; None for a fifth of a module.
        forward_weight: reward per meter of progress.
        success_bonus: reward of a success.
        effort_weight: cost per joule of the hinges' work.
        failure_cost: cost of a failure, which keeps none of the progress either.
        criteria: limits of a success; None for those of the body.
        search: what counts as a gap; None for the defaults.
    """
    touched = Termination("touched_pit", TouchedPit(bottomless))
    return Task(
        name="cross_gap",
        start=Start(start),
        goal=BeyondGap(search=search),
        terminations=make_terminations(stuck_time, stuck_progress, touched=touched),
        rewards=make_rewards(forward_weight, success_bonus, effort_weight, failure_cost),
        duration=duration,
        criteria=criteria,
    )
