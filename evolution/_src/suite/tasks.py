"""The tasks of the benchmark suite: an arena from a scan, its exact counterpart, a body and a budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

from evolution._src.backends.parts import BodyConfig
from evolution._src.backends.trials import Randomization, Trials
from evolution._src.errors import RunError
from evolution._src.suite.places import PLACES, find_published_arena, make_true_arena
from symbrion_gym._src.arenas.arena import Arena

if TYPE_CHECKING:
    from evolution._src.backends.trials import ArenaSource

VERSION = "2"
"""Raised when a task changes, so that scores of different suites are never compared."""
BUDGET = 1000.0
"""Simulated time that a method may spend on a task with one seed [s]."""
EXAM_TRIALS = 10
"""Trials of a score, under conditions that no method has seen."""
EXAM_SEED = (22, 2026)
"""Seed of the conditions of a score; learning uses one number more."""
LARGEST = 5
"""Modules of a body that may be chosen."""


@dataclass(frozen=True)
class SuiteTask:
    """A task of the suite.

    Attributes:
        name: its name.
        arena: what a method may use: the name of a ready-made arena, or of a place.
        truth: what the arena was scanned from, which judges alone; None for the exact place of the same name.
        body: body plan, name or number of modules; None: the method chooses, up to five modules.
        options: of the environment.
    """

    name: str
    arena: str
    body: str | int | None
    truth: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def make_trials(
        self,
        body: Any,
        controller: Any,
        count: int,
        seed: tuple[int, ...],
        in_truth: bool = False,
        descriptors: tuple[str, ...] = (),
    ) -> Trials:
        """Return trials of a genotype."""
        return Trials(
            arena=find_arena(self, in_truth),
            body=BodyConfig(organism=body),
            controller=controller,
            randomization=Randomization(stretch=(1.0,)),
            count=count,
            seed=seed,
            descriptors=descriptors,
            **self.make_options(),
        )

    def make_options(self) -> dict[str, Any]:
        """Return the options of the environment, those of all tasks included."""
        return {"track_control": "skid", "duration": 15.0} | dict(self.options)


CROSS = "SBSFSBSF0000SLSF0000SRSF00000000"
"""A module with others on all sides: five modules."""
_GAP = {"task": "cross_gap", "start": "pit"}
_WIDE = _GAP | {"duration": 30.0}
_CLIMB, _FALLEN = {"task": "climb"}, {"task": "recover"}
_SIDE = {"task": "traverse", "start": (-1.0, 0.55), "duration": 30.0}
"""Along the side of the rough ground, where hills turn a row of three that only drives ahead."""
SUITE: tuple[SuiteTask, ...] = (
    SuiteTask("wide pit, 8 in a row", "gsrm", 8, "truth", _WIDE),
    SuiteTask("gap, 4 in a row", "gap", 4, None, _GAP),
    SuiteTask("stairs, 3 in a row", "stairs", 3, None, _CLIMB),
    SuiteTask("stairs, 5 in a row", "stairs", 5, None, _CLIMB),
    SuiteTask("fallen, cross", "stairs", CROSS, None, _FALLEN),
    SuiteTask("gap, any body", "gap", None, None, _GAP),
    SuiteTask("stairs, any body", "stairs", None, None, _CLIMB),
    SuiteTask("rough ground, any body", "rough", None, None, _SIDE),
)


def find_suite_task(name: str) -> SuiteTask:
    """Return a task by its name."""
    for task in SUITE:
        if task.name == name:
            return task
    raise RunError(
        f"no task {name!r} in suite {VERSION}; there are: {'; '.join(each.name for each in SUITE)}"
    )


def find_arena(task: SuiteTask, in_truth: bool) -> ArenaSource:
    """Return the arena of a task."""
    if not in_truth:
        is_place = task.arena in PLACES
        return str(find_published_arena(task.arena)) if is_place else task.arena
    return _make_true(task.arena) if task.truth is None else task.truth


@cache
def _make_true(name: str) -> Arena:
    return make_true_arena(name)
