"""The tasks of the benchmark suite: an arena from a scan, its exact counterpart, a body and a budget."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evolution._src.backends.settings import Randomization
from evolution._src.backends.trials import Trials
from evolution._src.errors import RunError
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.assets import find_assets

if TYPE_CHECKING:
    from evolution._src.backends.trials import ArenaSource

COURSES = {
    "pit": Course(pit=0.50),
    "stairs": StairsCourse(steps=2, rise=0.09, run=0.30, floor=1.2, plateau=1.2),
}
"""Places by name: a pit five sixths as wide as a row of five is long (0.61 m), and steps eight times as high as the
radius of the rollers in a track (0.011 m)."""


@cache
def make_true_arena(name: str) -> Arena:
    """Return a place as it is, which judges alone."""
    return Arena.from_course(COURSES[name], f"{name}-truth")


def find_published_arena(name: str) -> Path:
    """Return the folder of a scanned arena that ships with the package."""
    return find_assets() / "suite" / "arenas" / name


VERSION = "8"  # Raised when a task changes, so that scores of different suites are never compared
BUDGET = 8000.0  # Simulated time that a method may spend on a task with one seed [s]


@dataclass(frozen=True)
class SuiteTask:
    """A task of the suite."""

    name: str  # its name
    place: str  # whose scan a method may use; the place as it is judges alone
    body: str | int  # body plan, name or number of modules
    options: Mapping[str, Any] = field(default_factory=dict)  # of the environment

    def make_trials(
        self, arena: "ArenaSource", body: Any, controller: Any, count: int, seed: tuple[int, ...]
    ) -> Trials:
        """Return trials of a genotype."""
        return Trials(
            arena=arena,
            organism=body,
            controller=controller,
            randomization=Randomization(stretch=(1.0,)),
            count=count,
            seed=seed,
            **self.make_options(),
        )

    def make_options(self) -> dict[str, Any]:
        """Return the options of the environment, those of all tasks included."""
        return {"track_control": "body", "duration": 15.0} | dict(self.options)

    def find_scan(self) -> str:
        """Return the scanned arena that a method may use."""
        return str(find_published_arena(self.place))


SUITE: tuple[SuiteTask, ...] = (
    SuiteTask("pit, 5 in a row", "pit", 5, {"task": "cross_gap", "start": "pit", "duration": 30.0}),
    SuiteTask("stairs, 5 in a row", "stairs", 5, {"task": "climb"}),
)
SEEDS = (*range(10), *range(26, 46))
"""Of a method: all are needed for a place, no others count. The tasks were chosen with seeds 10 to 25."""


def find_suite_task(name: str) -> SuiteTask:
    """Return a task by its name."""
    tasks = {task.name: task for task in SUITE}
    if name not in tasks:
        raise RunError(f"no task {name!r} in suite {VERSION}; there are: {'; '.join(tasks)}")
    return tasks[name]
