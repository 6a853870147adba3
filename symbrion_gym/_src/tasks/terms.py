"""The terms of a task: goals, terminations and rewards are functions of the state of N simulations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.starts import Start

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.tasks.route import Route
    from symbrion_gym._src.tasks.state import TaskState

Condition: TypeAlias = "Callable[[TaskState], Bool[np.ndarray, ' N']]"
"""From the state of N simulations to whether something is so in each."""
Measure: TypeAlias = "Callable[[TaskState], Float[np.ndarray, ' N']]"
"""From the state of N simulations to a number of each."""
BASE_FLAGS = ("success", "diverged")  # Flags of `info` that every task has


@runtime_checkable
class Goal(Protocol):
    """What arriving means.

    A goal may also have `limits(state)`, as `Termination` explains; `distance_to_goal(state) -> [N]`, the way that is
    left; and `find_target(state) -> [N, 2]`, the place (x, y) to head for.
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
    function: Condition
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
    function: Measure
    weight: float = 1.0
    per_second: bool = False
    at_end: bool = False

    def __post_init__(self) -> None:
        _check_term(self)
        if not np.isfinite(self.weight):
            raise TaskError(f"reward {self.name!r}: weight must be a finite number, got {self.weight!r}")


def _check_term(term: Termination | Reward) -> None:
    kind = type(term).__name__
    if not (isinstance(term.name, str) and term.name.isidentifier()):
        raise TaskError(f"{kind}: a name is an identifier such as 'fell', got {term.name!r}")
    if not callable(term.function):
        raise TaskError(f"{kind} {term.name!r}: its function cannot be called: {term.function!r}")
