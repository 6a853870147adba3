"""What ends an episode beside success and time. Each is a value; without arguments its limits fit the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.state import TaskState
from symbrion_gym._src.tasks.terms import Termination

_LARGEST_REACH = 1.5
"""A turned module reaches at most the root of 2 half edges below its center; with room to spare."""
_LEAST_PROGRESS = 0.2  # Share of a module's length that counts as progress
Limits = dict[str, "float | Float[np.ndarray, ' N']"]


@dataclass(frozen=True)
class RolledOver:
    """Detect that a module has rolled over."""

    below: float | None = None  # z of its up axis; None for that of the task's criteria

    def _find_least(self, state: TaskState) -> float:
        return state.criteria.rolled_over if self.below is None else self.below

    def limits(self, state: TaskState) -> Limits:
        """Return the limits within which nothing has happened."""
        return {"least_up": self._find_least(state)}

    def __call__(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether a module leans by more."""
        return state.least_up < self._find_least(state)


@dataclass(frozen=True)
class FellOff:
    """Detect that a module is off the side of the way, or below the arena."""

    def limits(self, state: TaskState) -> Limits:
        """Return the limits within which nothing has happened."""
        return {"least_left": -state.half_width, "least_right": -state.half_width, "lowest": state.deepest}

    def __call__(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether a module is off the arena."""
        is_beside = state.xp.minimum(state.least_left, state.least_right) < -state.half_width
        return is_beside | (state.lowest < state.deepest)


@dataclass(frozen=True)
class TouchedPit:
    """Detect that a module touches the floor of the pit on the way, as if the pit had none."""

    is_bottomless: bool = True  # without it, nothing is detected

    def limits(self, state: TaskState) -> Limits:
        """Return the limits within which nothing has happened."""
        return {
            "lowest": _find_pits(state)[2] + _LARGEST_REACH * _find_half(state)
            if self.is_bottomless
            else -np.inf
        }

    def __call__(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether a module touches the floor."""
        if not self.is_bottomless:
            return np.zeros(state.num, dtype=bool)
        near, far, touched = _find_pits(state)[:, :, None]
        reach = _find_half(state) * state.xp.abs(state.rotation[:, :, 6:9:2]).sum(axis=2)
        is_down = state.position[:, :, 2] - reach < touched
        return (is_down & (state.along > near) & (state.along < far)).any(axis=1)


def _find_half(state: TaskState) -> float:
    return state.organism.scout.size[2] / 2


def _find_pits(state: TaskState) -> Float[np.ndarray, "3 N"]:
    """Return near edge and far edge of the pit along the way, and the height at which its floor is touched [m]."""
    none = (np.inf, -np.inf, -np.inf)
    pits = np.array([none if scene.route.pit is None else scene.route.pit for scene in state.scenes]).T
    pits[2] += state.criteria.touch_band
    return pits


@dataclass(frozen=True)
class Stuck:
    """Detect that a body makes no more progress.

    Raises:
        TaskError: a number is out of range.
    """

    after: float = 15.0  # time without progress [s]
    # smallest progress that counts as such; None for a fifth of a module's length [m]
    progress: float | None = None

    def __post_init__(self) -> None:
        check_positive(self, ("after",), TaskError)
        if self.progress is not None:
            check_not_negative(self, ("progress",), TaskError)

    def _recall(self, state: TaskState) -> tuple[np.ndarray, np.ndarray]:
        """Return the progress beyond which each body has moved on, and the tick before which its time is not up."""
        return state.remember("stuck_progress", self._start), state.remember("stuck_tick", self._wait(state))

    def _find_least(self, state: TaskState) -> float:
        return _LEAST_PROGRESS * state.organism.scout.size[0] if self.progress is None else self.progress

    def _wait(self, state: TaskState) -> float:
        return round(self.after / state.dt) - 0.5

    def _start(self, state: TaskState) -> Float[Any, " N"]:
        return state.start_progress + self._find_least(state)

    def limits(self, state: TaskState) -> Limits:
        """Return the limits within which nothing has happened and nothing is to be remembered."""
        progress, tick = self._recall(state)
        return {"progress": progress, "tick": tick}

    def __call__(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether the time is up; remember those that moved on."""
        progress, tick = self._recall(state)
        has_moved = state.progress > progress
        if state.may_hold(has_moved):
            state.keep("stuck_progress", state.progress + self._find_least(state), has_moved)
            state.keep("stuck_tick", state.tick + self._wait(state), has_moved)
            _, tick = self._recall(state)
        return state.tick > tick


def make_terminations(
    stuck_time: float = 15.0, stuck_progress: float | None = None, **others: Termination
) -> tuple[Termination, ...]:
    """Return the usual terminations: rolled over, fell, and stuck."""
    return (
        Termination("rolled_over", RolledOver()),
        Termination("fell", FellOff()),
        *others.values(),
        Termination("stuck", Stuck(stuck_time, stuck_progress), truncates=True),
    )
