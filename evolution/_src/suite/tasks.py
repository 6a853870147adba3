"""The tasks of the benchmark suite: an arena from a scan, its exact counterpart, a body and a budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from evolution._src.backends.settings import Randomization
from evolution._src.backends.trials import Trials
from evolution._src.errors import RunError
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.assets import find_assets
from symbrion_gym._src.contact.quality import ArenaQuality

if TYPE_CHECKING:
    from evolution._src.backends.trials import ArenaSource

GAP = Course(pit=0.25, height=0.25, floor=1.2, ramp=0.8, plateau=0.8)
"""A row of five modules crosses it without control, rows of three and four do not."""
STAIRS = StairsCourse(steps=2, rise=0.05, run=0.30, floor=1.2, plateau=1.2)
"""Steps four times the radius of the rollers in a track (0.011 m), which do not roll up a vertical wall."""
COURSES = {"gap": GAP, "stairs": STAIRS}
PLACES = (*COURSES, "rough")
GROUND_LENGTH, GROUND_WIDTH = 3.6, 2.0  # Size of the rough ground [m]
HILLS_FROM, HILLS_TO = -0.6, 1.4  # x between which there are hills on it [m]
_NUM_HILLS, _CORNERS = 45, 7
_RADII = (0.10, 0.30)  # Smallest and largest radius of a hill [m]
_SLOPES = (0.25, 0.6)  # Smallest and largest slope of its sides
_FLOOR = 0.2  # Thickness of the ground [m]


def make_hills() -> list[trimesh.Trimesh]:
    """Return the convex solids of the rough ground: a slab, and blunt cones of random size and slope on it."""
    rng = np.random.default_rng(0)
    slab = trimesh.creation.box((GROUND_LENGTH, GROUND_WIDTH, _FLOOR))
    solids = [slab.apply_translation((0.0, 0.0, -_FLOOR / 2))]
    for _ in range(_NUM_HILLS):
        radius = rng.uniform(*_RADII)
        center = rng.uniform(HILLS_FROM, HILLS_TO), rng.uniform(-1.0, 1.0) * (GROUND_WIDTH / 2 - _RADII[1])
        solids.append(_make_hill(rng, center, radius, rng.uniform(*_SLOPES)))
    return solids


def _make_hill(
    rng: np.random.Generator, center: tuple[float, float], radius: float, slope: float
) -> trimesh.Trimesh:
    """Return a cone with its tip cut off, its foot in the slab."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 2 * _CORNERS))[::2]
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    top = 0.6 * radius * slope
    levels = ((1.0, 0.0), (0.4, top), (1.0, -_FLOOR / 2))
    corners = [np.column_stack([share * radius * rim, np.full(len(rim), z)]) for share, z in levels]
    return trimesh.convex.convex_hull(np.concatenate(corners) + np.array((*center, 0.0)))


@cache
def make_true_arena(name: str) -> Arena:
    """Return a place as it is, which judges alone."""
    if name in COURSES:
        return Arena.from_course(COURSES[name], f"{name}-truth")
    solids = make_hills()
    surface = trimesh.boolean.union(solids, engine="manifold")
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(solids))
    return Arena(f"{name}-truth", solids, surface, quality, friction_source="exact")


def find_published_arena(name: str) -> Path:
    """Return the folder of a scanned arena that ships with the package."""
    return find_assets() / "suite" / "arenas" / name


VERSION = "2"  # Raised when a task changes, so that scores of different suites are never compared
BUDGET = 1000.0  # Simulated time that a method may spend on a task with one seed [s]
LARGEST = 5  # Modules of a body that may be chosen


@dataclass(frozen=True)
class SuiteTask:
    """A task of the suite."""

    name: str  # its name
    arena: str  # what a method may use: the name of a ready-made arena, or of a place
    # body plan, name or number of modules; None: the method chooses, up to five modules
    body: str | int | None
    # what the arena was scanned from, which judges alone; None for the exact place of the same name
    truth: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)  # of the environment

    def make_trials(
        self, arena: ArenaSource, body: Any, controller: Any, count: int, seed: tuple[int, ...]
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
        return {"track_control": "skid", "duration": 15.0} | dict(self.options)

    def find_scan(self) -> str:
        """Return the scanned arena that a method may use."""
        return str(find_published_arena(self.arena)) if self.arena in PLACES else self.arena

    def find_truth(self) -> ArenaSource:
        """Return the exact arena, which judges alone."""
        return make_true_arena(self.arena) if self.truth is None else self.truth


CROSS = "SBSFSBSF0000SLSF0000SRSF00000000"  # A module with others on all sides: five modules
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
