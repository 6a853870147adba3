"""The fitness of an outcome: the weights that ship, or any function of a user."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np

from evolution._src.errors import RunError
from evolution._src.references import Reference, check_signature, check_versions, find_object, find_versions
from reconstruction._src.base.range_checks import coerce_floats
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.recorders import (
    Descriptor,
    Extremes,
    FinalPose,
    GroundContacts,
    Recorder,
    Trajectory,
)
from symbrion_gym._src.tasks.storage import describe, restore

if TYPE_CHECKING:
    from evolution._src.backends.outcome import Outcome
    from symbrion_gym._src.robot.organism import Organism

ScoringFunction: TypeAlias = "Callable[[Outcome, Organism], float]"
MAX_WEIGHT = 1e6  # Largest weight of a term of the fitness [m of progress]


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
        coerce_floats(
            self, dict.fromkeys(("success", "effort", "module"), (-MAX_WEIGHT, MAX_WEIGHT)), RunError
        )

    def __call__(self, outcome: Outcome, body: Organism) -> float:
        """Return the fitness of an outcome of a body."""
        return self.score(outcome, body.num_modules)

    def score(self, outcome: Outcome, modules: int) -> float:
        """Return the fitness, higher is better, always finite."""
        rate = outcome.successes / max(outcome.trials, 1)
        return outcome.progress + self.success * rate - self.effort * outcome.effort - self.module * modules


def find_scoring(scoring: ScoringFunction | Reference | str) -> ScoringFunction | Reference:
    """Return a scoring, imported where it is named; a reference that a file contains stays one."""
    if isinstance(scoring, Reference):
        return scoring
    found: Any = find_object(scoring, "scoring") if isinstance(scoring, str) else scoring
    if isinstance(found, type):
        found = _make_instance(found)
    if not callable(found):
        raise RunError(f"scoring is {found!r}; a `Scoring`, or a function of (outcome, body), is needed")
    function = cast("ScoringFunction", found)
    if type(found) is not Scoring:
        check_signature(function, "scoring", "outcome", "body")
    return function


def _make_instance(found: type) -> object:
    try:
        return found()
    except Exception as error:  # code of the user
        raise RunError(f"scoring {found.__qualname__} cannot be made without arguments: {error}") from error


def compute_fitness(scoring: ScoringFunction | Reference, outcome: Outcome, body: Organism) -> float:
    """Return the fitness of an outcome."""
    if isinstance(scoring, Reference):
        raise RunError(f"scoring {scoring.name} is not imported; `resume` restores it")
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
Records: TypeAlias = dict[str, np.ndarray]  # What is kept of a trial: name -> numbers


@dataclass(frozen=True)
class StoredDescriptors:
    """What a file says of descriptors; nothing of them is imported yet."""

    text: str  # JSON text

    def restore(self, what: str, allow: Collection[str] = ()) -> tuple[Recorder, ...]:
        """Return the recorders; of the user's code only modules in `allow` are imported."""
        content = json.loads(self.text)
        versions = (
            content.pop() if content and isinstance(content[-1], dict) and "versions" in content[-1] else {}
        )
        try:
            check_versions(versions.get("versions", {}), what, allow)
            return check_descriptors(restore(content, allow))
        except (TaskError, AttributeError) as error:
            raise RunError(f"{what}: {error}") from error


def check_descriptors(descriptors: Any) -> Any:
    """Return recorders; what a file says of them stays as it is."""
    if isinstance(descriptors, StoredDescriptors):
        return descriptors
    if isinstance(descriptors, str) or not isinstance(descriptors, Sequence):
        descriptors = (descriptors,)
    return tuple(_find_recorder(each) for each in descriptors)


def _find_recorder(given: str | Recorder | Callable[..., Any]) -> Recorder:
    if isinstance(given, str):
        if given not in RECORDERS:
            raise RunError(f"descriptors has {given!r}; there are: {', '.join(RECORDERS)}")
        return RECORDERS[given]
    if isinstance(given, Recorder) and not isinstance(given, type):
        return given
    if callable(given):
        return Descriptor(getattr(given, "__name__", type(given).__name__), given)
    raise RunError(f"descriptors has {given!r}; a name, a recorder or a function of the state is needed")


def descriptors_to_json(descriptors: Any) -> Any:
    """Return JSON content that restores recorders."""
    if isinstance(descriptors, StoredDescriptors):
        return json.loads(descriptors.text)
    try:
        content = describe(descriptors)
    except TaskError as error:
        raise RunError(f"descriptors: {error}") from error
    versions = find_versions(content, "descriptors")
    return [*content, {"versions": versions}] if versions else content


def as_records(kept: Mapping[str, Any]) -> Records:
    """Return what recorders kept as numbers that a file holds."""
    return {name: np.asarray(value, dtype=np.float64) for name, value in kept.items()}
