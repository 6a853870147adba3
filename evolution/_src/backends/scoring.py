"""The outcome of trials and its fitness, by the weights that ship or any function of a user; what is kept of trials."""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np

from evolution._src.errors import RunError
from evolution._src.references import Stored, find_object
from reconstruction._src.base.range_checks import coerce_floats
from symbrion_gym._src.tasks.recorders import (
    Descriptor,
    Extremes,
    FinalPose,
    GroundContacts,
    Recorder,
    Trajectory,
)

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

ScoringFunction: TypeAlias = "Callable[[Outcome, Organism], float]"
_MAX_WEIGHT = 1e6  # Largest weight of a term of the fitness [m of progress]


@dataclass(frozen=True)
class Outcome:
    """The result of a genotype's trials.

    Attributes:
        progress: progress of the whole body, mean over trials [m].
        effort: mean over trials.
        succeeded: for each trial, whether the strict success check passed.
        seconds: simulated, summed over trials [s].
        diverged: number of trials whose physics diverged.
        error: why it could not be tried; empty if it could.
        descriptors: for each trial, what `TrialConfig.descriptors` kept of it: name -> numbers; empty without any.
    """

    progress: float
    effort: float
    succeeded: tuple[bool, ...]
    seconds: float = 0.0
    diverged: int = 0
    error: str = ""
    descriptors: tuple[dict[str, np.ndarray], ...] = field(default=(), compare=False)

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.succeeded)

    @property
    def successes(self) -> int:
        """Number of successful trials."""
        return sum(self.succeeded)


@dataclass(frozen=True)
class Scoring:
    """How an outcome becomes a fitness: progress + success - effort - body.

    Any function of (outcome, body) is a scoring, too. A subclass may override `score` or `__call__`; a run keeps its
    name, version and fields, and restores it.

    Attributes:
        success: reward of a success rate of 1 [m of progress].
        effort: penalty for a unit of effort.
        module: penalty for each module; only relevant where the length of the body evolves.
    """

    success: float = 1.0
    effort: float = 0.2
    module: float = 0.05

    def __post_init__(self) -> None:
        limits = (-_MAX_WEIGHT, _MAX_WEIGHT)
        coerce_floats(self, {"success": limits, "effort": limits, "module": limits}, RunError)

    def __call__(self, outcome: Outcome, body: "Organism") -> float:
        """Return the fitness of an outcome of a body."""
        return self.score(outcome, body.num_modules)

    def score(self, outcome: Outcome, modules: int) -> float:
        """Return the fitness, higher is better, always finite."""
        rate = outcome.successes / max(outcome.trials, 1)
        return outcome.progress + self.success * rate - self.effort * outcome.effort - self.module * modules


def find_scoring(scoring: Any) -> Any:
    """Return a scoring, imported where it is named; what a file says of one stays as it is."""
    if isinstance(scoring, Stored):
        return scoring
    found = find_object(scoring, "scoring") if isinstance(scoring, str) else scoring
    if isinstance(found, type):
        try:
            found = found()
        except Exception as error:  # code of the user
            raise RunError(f"scoring {found} cannot be made without arguments: {error}") from error
    if type(found) is Scoring:
        return found
    try:
        inspect.signature(found).bind("outcome", "body")
    except (TypeError, ValueError) as error:
        raise RunError(
            f"scoring is {found!r}; a `Scoring`, or a function of (outcome, body), is needed ({error})"
        ) from error
    return found


def compute_fitness(scoring: Any, outcome: Outcome, body: "Organism") -> float:
    """Return the fitness of an outcome."""
    if isinstance(scoring, Stored):
        raise RunError("the scoring of a file is not imported; `resume` restores it")
    try:
        fitness = float(scoring(outcome, body))
    except Exception as error:  # code of the user
        raise RunError(f"scoring raised {type(error).__name__}: {error}") from error
    if not math.isfinite(fitness):
        raise RunError(f"scoring returned {fitness}; a finite number is needed (outcome: {outcome})")
    return fitness


RECORDERS: Mapping[str, Recorder] = {
    "pose": FinalPose(),
    "extremes": Extremes(),
    "contacts": GroundContacts(),
    "trajectory": Trajectory(),
}
"""Recorders by name."""


def check_descriptors(descriptors: Any) -> Any:
    """Return recorders; what a file says of them stays as it is."""
    if isinstance(descriptors, Stored):
        return descriptors
    if isinstance(descriptors, str) or not isinstance(descriptors, Sequence):
        descriptors = (descriptors,)
    return tuple(_find_recorder(each) for each in descriptors)


def _find_recorder(given: Any) -> Recorder:
    if isinstance(given, str) and given in RECORDERS:
        return RECORDERS[given]
    if isinstance(given, Recorder) and not isinstance(given, type):
        return given
    if callable(given):
        return Descriptor(getattr(given, "__name__", type(given).__name__), cast(Any, given))
    raise RunError(
        f"descriptors has {given!r}; a recorder, a function of the state, or one of {', '.join(RECORDERS)} is needed"
    )
