"""The task of crossing a gap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features import GapSearch, find_gap
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.route import Point, Route, StartName
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terminations import TouchedPit, make_terminations
from symbrion_gym._src.tasks.terms import Termination
from symbrion_gym._src.tasks.usual_terms import UsualTerms
from symbrion_gym._src.tasks.ways import make_route


@dataclass(frozen=True)
class BeyondGap(PassFinish):
    """Get every module across the first gap on the way.

    Attributes:
        search: what counts as a gap; None for the defaults.
    """

    search: GapSearch | None = None

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
