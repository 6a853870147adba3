"""The trials of a genotype.

A `Job` describes everything that decides its outcome; the worker, the other jobs and the number of threads have no
influence. That is why batch, processes and a Ray cluster give equal results.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from evolution._src.backends.scoring import Outcome
from evolution._src.backends.settings import BodyConfig, TrialConfig
from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.assets import NAMED_ARENAS

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena

    ArenaSource: TypeAlias = str | PathLike[str] | Arena

FAILED_PROGRESS = -1.0
"""Progress [m] of a trial that could not be finished: below any that a finished trial can have."""
_MAX_ERROR_LENGTH = 200  # Characters of an error that a record keeps


@dataclass(frozen=True, kw_only=True)
class Trials(TrialConfig, BodyConfig):
    """The trials of a genotype: an episode, a body, and how often it is tried."""

    # those of an `Evaluator`
    OTHERS: ClassVar[tuple[str, ...]] = ("trials", "scoring", "backend", "workers", "address")

    arena: "ArenaSource" = "truth"  # name, folder, file or, on backend "batch", an `Arena`
    controller: Any = "reactive"
    count: int = 2  # number of trials, each under other conditions
    seed: tuple[int, ...] = (0,)  # seed of the conditions; equal seeds mean equal conditions

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_body()


def find_trial_controller(trials: Trials) -> Controller:
    """Return the controller of trials, for their body."""
    return trials.make_controller(trials.find_organism())


class Job(NamedTuple):
    """One genotype and its trials."""

    genotype: Float[np.ndarray, " G"]
    trials: Trials


def make_failure(trials: Trials, error: str) -> Outcome:
    """Return the outcome of a job that could not be tried."""
    return Outcome(FAILED_PROGRESS, 0.0, (False,) * trials.count, error=error[:_MAX_ERROR_LENGTH])


def check_tried(outcomes: Sequence[Outcome]) -> None:
    """Refuse outcomes of which every one is the same error: no genotype is to blame."""
    errors = {"" if outcome.diverged else outcome.error for outcome in outcomes}
    if len(errors) == 1 and "" not in errors:
        raise RunError(f"none of {len(outcomes)} genotypes could be tried: {errors.pop()}")


_MAX_ARENAS = 4  # Arenas that a process keeps
_arenas: "OrderedDict[object, Arena]" = OrderedDict()


def find_arena_key(arena: "ArenaSource") -> object:
    """Return what tells arenas apart: a name, a path and when it was written, or the identity of an `Arena`."""
    if not isinstance(arena, str | PathLike):
        return id(arena)
    if arena in NAMED_ARENAS:
        return arena
    path = Path(arena)
    try:
        return str(arena), (path / "arena.json" if path.is_dir() else path).stat().st_mtime_ns
    except OSError:
        return str(arena), 0


def prepare_arena(arena: "ArenaSource", progress: Progress = silent) -> "ArenaSource":
    """Return an arena, loaded or built where it is a file or a folder; the next call returns the same one."""
    if not isinstance(arena, str | PathLike) or arena in NAMED_ARENAS:
        return arena
    key = find_arena_key(arena)
    if key not in _arenas:
        from symbrion_gym._src.arenas.making import load_arena

        found = load_arena(str(arena), progress=progress)
        while len(_arenas) >= _MAX_ARENAS:
            _arenas.popitem(last=False)
        _arenas[key] = found
    _arenas.move_to_end(key)
    return _arenas[key]
