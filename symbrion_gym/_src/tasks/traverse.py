"""The task of traversing rough ground as far as possible."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.route import Point, Route, StartName, find_route
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.usual_terms import UsualTerms

_SAMPLES = 0.02
"""Spacing of the heights along the way [m]."""
_CLIMB = 1.2
"""A body rears up or lowers itself over walls of this share of a module's height at most."""


@dataclass(frozen=True)
class FarEnd(PassFinish):
    """Get every module to the far end of the ground straight ahead: to its rim, or to a wall or drop on it.

    Attributes:
        share: share of the way to the far end that has to be traversed.

    Raises:
        TaskError: the share is not above 0 and up to 1.
    """

    share: float = 0.9

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.share <= 1.0:
            raise TaskError(f"share must be above 0, up to 1, got {self.share!r}")

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the straight way over the ground and where it ends."""
        bare = replace(arena, course=None)
        route = find_route(bare, organism, start.place, self.place, self.margins, self.pit_search)
        tail = -min(pose.x for pose in organism.find_poses())
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
