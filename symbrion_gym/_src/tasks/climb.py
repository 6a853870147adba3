"""The task of climbing a step, stairs or a ramp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features import Way, find_ramp, find_stairs, find_step
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.route import Point, Route, StartName
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.usual_terms import UsualTerms
from symbrion_gym._src.tasks.ways import make_route

OBSTACLES = ("stairs", "step", "ramp")


@dataclass(frozen=True)
class OnTop(PassFinish):
    """Get every module past the top of a step, of stairs or of a ramp.

    Attributes:
        obstacle: "stairs", "step" or "ramp"; "any" for the first kind that is there, in this order.

    Raises:
        TaskError: there is no such kind.
    """

    obstacle: str = "any"

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
