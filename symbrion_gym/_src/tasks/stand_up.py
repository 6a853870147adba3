"""The goal that is no place: to stand up after a tumble."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import find_honest, find_standing
from symbrion_gym._src.tasks.paths import find_path
from symbrion_gym._src.tasks.route import Route, Start
from symbrion_gym._src.tasks.state import TaskState, add_up


@dataclass(frozen=True)
class StandUp:
    """Get every module upright and on the ground."""

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find a place on the map with room around it, unless the start is a place."""
        return find_path(arena, organism, start, ())

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the mean z of the modules' up axes, from -1 to 1."""
        return add_up(state.up) * (1.0 / state.up.shape[1])

    def limits(self, state: TaskState) -> dict[str, float]:
        return {"progress": state.criteria.upright}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether every module is upright and on the ground."""
        has_arrived = (state.least_up > state.criteria.upright) & find_honest(state)
        return state.confirm(has_arrived, lambda rows: find_standing(state, rows))
