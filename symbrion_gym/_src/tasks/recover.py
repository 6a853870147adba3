"""The task of recovering: to stand up after a tumble."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.paths import find_path
from symbrion_gym._src.tasks.route import Point, Route, StartName
from symbrion_gym._src.tasks.standing import find_honest, find_standing
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.state import TaskState, add_up
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terminations import FellOff, Stuck
from symbrion_gym._src.tasks.terms import Termination
from symbrion_gym._src.tasks.usual_terms import UsualTerms

_RIGHTING = 0.05
"""Change of the mean uprightness that counts as progress."""


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
