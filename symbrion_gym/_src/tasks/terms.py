"""The terms of a task: goals, terminations and rewards, as functions of the state of N simulations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import TaskError

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.tasks.route import Route, Start
    from symbrion_gym._src.tasks.state import TaskState

Limits = dict[str, "float | Float[np.ndarray, ' N']"]
BASE_FLAGS = ("success", "diverged")  # Flags of `info` that every task has


@runtime_checkable
class Goal(Protocol):
    """What arriving means.

    A goal may also have `limits(state)`, as `Termination` explains, and `find_target(state) -> [N, 2]`, the place
    (x, y) to head for.
    """

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the way from the start on the map."""
        ...

    def progress(self, state: TaskState) -> Float[np.ndarray, " N"]:
        """Return how far each body has come [m], or in a unit of the goal's own."""
        ...

    def has_arrived(self, state: TaskState) -> Bool[np.ndarray, " N"]:
        """Return whether each body is where it should be, as it should be."""
        ...


@dataclass(frozen=True)
class Termination:
    """Something that ends an episode; a flag of its name is in `info`.

    A function may have a method `limits(state)` that returns name -> `[N]` or a number for some of
    `symbrion_gym._src.tasks.state.MEASURES`. As long as these measures keep to the limits, the function is certainly
    False and has nothing to remember; it is then not called, which saves time. A function without it is called in
    every tick.

    Attributes:
        name: name of the flag.
        function: state -> `[N]` truth values.
        is_failure: whether the episode has failed; with `truncates` it never has.
        truncates: whether the episode is cut off, rather than over.

    Raises:
        TaskError: the name is no identifier or has a meaning already, or the function cannot be called.
    """

    name: str
    function: Callable[[TaskState], Bool[np.ndarray, " N"]]
    is_failure: bool = True
    truncates: bool = False

    def __post_init__(self) -> None:
        _check_term(self)
        if self.name in BASE_FLAGS:
            raise TaskError(f"every task has a flag {self.name!r}; give the termination another name")
        if self.truncates:
            object.__setattr__(self, "is_failure", False)


@dataclass(frozen=True)
class Reward:
    """A term of the reward; `reward_<name>` is in `info`.

    Attributes:
        name: name of the term.
        function: state -> `[N]` numbers.
        weight: factor.
        per_second: the function returns a rate; it is multiplied by the length of a tick as well.
        at_end: given once, in the tick that ends the episode; the function is not called in others.

    Raises:
        TaskError: the name is no identifier, the function cannot be called, or the weight is not finite.
    """

    name: str
    function: Callable[[TaskState], Float[np.ndarray, " N"]]
    weight: float = 1.0
    per_second: bool = False
    at_end: bool = False

    def __post_init__(self) -> None:
        _check_term(self)
        if not np.isfinite(self.weight):
            raise TaskError(f"reward {self.name!r}: weight must be a finite number, got {self.weight!r}")


def _check_term(term: Termination | Reward | Sensor) -> None:
    kind = type(term).__name__
    if not (isinstance(term.name, str) and term.name.isidentifier()):
        raise TaskError(f"{kind}: a name is an identifier such as 'fell', got {term.name!r}")
    if not callable(term.function):
        raise TaskError(f"{kind} {term.name!r}: its function cannot be called: {term.function!r}")


@dataclass(frozen=True)
class Sensor:
    """A part of the observation of a user's own, read after every tick and at the start of an episode.

    Attributes:
        name: name of the part.
        size: number of values.
        low: smallest value: a number, or one for each value.
        high: largest value, likewise; values beyond are clipped.
        function: state -> `[N, size]` numbers, from the state that the terms of the task see.

    Raises:
        TaskError: the name is no identifier, the function cannot be called, or the bounds do not fit.
    """

    name: str
    size: int
    low: float | tuple[float, ...]
    high: float | tuple[float, ...]
    function: Callable[[TaskState], Float[Any, "N size"]]

    def __post_init__(self) -> None:
        _check_term(self)
        try:
            bounds = [
                np.broadcast_to(np.asarray(each, float), (self.size,)) for each in (self.low, self.high)
            ]
        except (TypeError, ValueError):
            bounds = []
        if not (bounds and self.size > 0 and np.isfinite(bounds).all() and (bounds[0] < bounds[1]).all()):
            found = f"size {self.size!r}, low {self.low!r}, high {self.high!r}"
            raise TaskError(
                f"Sensor {self.name!r}: a size of 1 or more, and finite low < high of that size, got {found}"
            )
        for name, bound in zip(("low", "high"), bounds, strict=True):
            object.__setattr__(self, name, tuple(bound.tolist()))

    def read(self, state: TaskState) -> Float[Any, "N size"]:
        """Return the values.

        Raises:
            TaskError: the function returns another shape.
        """
        values = self.function(state)
        if np.shape(values) != (state.num, self.size):
            need = f"an array of shape ({state.num}, {self.size}) is needed"
            raise TaskError(f"sensor {self.name!r} returned {np.shape(values)}; {need}")
        return values


_LARGEST_REACH = 1.5
"""A turned module reaches at most the root of 2 half edges below its center; with room to spare."""
_LEAST_PROGRESS = 0.2  # Share of a module's length that counts as progress


@dataclass(frozen=True)
class RolledOver:
    """Detect that a module has rolled over: leans by more than the task's criteria allow."""

    def limits(self, state: TaskState) -> Limits:
        return {"least_up": state.criteria.rolled_over}

    def __call__(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether a module leans by more."""
        return state.least_up < state.criteria.rolled_over


@dataclass(frozen=True)
class FellOff:
    """Detect that a module is off the side of the way, or below the arena."""

    def limits(self, state: TaskState) -> Limits:
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
        reach = _LARGEST_REACH * _find_half(state)
        return {"lowest": _find_pits(state)[2] + reach if self.is_bottomless else -np.inf}

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
    pits = np.array([state.scene.route.pit or none] * state.num).T
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
        return (
            state.remember("stuck_progress", lambda state: state.start_progress + self._find_least(state)),
            state.remember("stuck_tick", self._wait(state)),
        )

    def _find_least(self, state: TaskState) -> float:
        return _LEAST_PROGRESS * state.organism.scout.size[0] if self.progress is None else self.progress

    def _wait(self, state: TaskState) -> float:
        return round(self.after / state.dt) - 0.5

    def limits(self, state: TaskState) -> Limits:
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


def gain_progress(state: TaskState) -> Float[Any, " N"]:
    """Return the progress of this tick; falling forwards counts."""
    return state.progress - state.previous_progress


def gain_potential(state: TaskState) -> Float[Any, " N"]:
    """Return the change of a potential that is the progress, and that of the start where it ended without success.

    So the terms of an episode without success add up to nothing, whether it failed, was stuck or took too long (Ng,
    Harada and Russell 1999, with no discount and the potential of the start in every such last state).
    """
    now, is_lost = state.progress, state.ended & ~state.success
    if state.may_hold(is_lost):
        now = state.xp.where(is_lost, state.start_progress, now)
    return now - state.previous_progress


def has_succeeded(state: TaskState) -> Float[Any, " N"]:
    """Return 1 for a success."""
    return state.success.astype(state.progress.dtype)


def has_failed(state: TaskState) -> Float[Any, " N"]:
    """Return 1 for a failure: rolled over, fell, diverged and what else the task counts as one."""
    return state.failed.astype(state.progress.dtype)


def spend_power(state: TaskState) -> Float[Any, " N"]:
    """Return the absolute power of the hinges [W]."""
    return state.power


def make_rewards(
    forward: float = 1.0, success: float = 1.0, effort: float = 0.002, failure: float = 1.0
) -> tuple[Reward, ...]:
    """Return the usual rewards of the tasks: potential of progress, success, failure, work of the hinges."""
    return (
        Reward("forward", gain_potential, forward),
        Reward("success", has_succeeded, success, at_end=True),
        Reward("failure", has_failed, -failure, at_end=True),
        Reward("effort", spend_power, -effort, per_second=True),
    )
