"""What the landscape is made of: its tasks, the bodies, and how much each body learns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from evolution._src.backends.trials import Randomization, RolloutConfig
from evolution._src.body_search.config import BodiesConfig, BodyEvolutionConfig
from evolution._src.body_search.learning import LearningConfig
from evolution._src.errors import RunError
from evolution._src.limits import MAX_SEED, MIN_POSITIVE
from reconstruction._src.base.range_checks import coerce_floats, coerce_integers

LARGEST = 6
"""More modules have thousands of bodies."""
_LONGEST = 600.0
CHILDREN = 12
"""Bodies that learn side by side, and after which the state is stored."""
TASKS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "pit": {"task": "cross_gap", "start": "pit"},
        "stairs": {"task": "climb"},
        "rough": {"task": "traverse"},
    }
)
"""Options of the environment by the name of the place."""
HELD_OUT_TASKS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {"gap": TASKS["pit"], "low_stairs": TASKS["stairs"], "other_hills": TASKS["rough"]}
)
"""The same for places on which searches for bodies were not developed before they were searched there once."""
SECOND_HELD_OUT_TASKS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {"one_step": TASKS["stairs"], "sill": TASKS["rough"], "steep_hills": TASKS["rough"]}
)
"""The same for the search that was developed on those, too."""


@dataclass(frozen=True)
class LandscapeConfig:
    """Everything that decides the numbers of the landscape.

    Attributes:
        largest: largest number of modules: 5 have 173 bodies, 6 have 816.
        seed: seed of learning and of the conditions of trials.
        population_size: genotypes of a generation of CMA-ES.
        generations: generations after which a body is examined; it has learned them all at the last. The first is
            the genotype at which learning begins, alone.
        exam_trials: trials of an exam.
        duration: longest time of a trial [s]; the fastest bodies cross the pit in half of it.
        stuck_time: a trial without progress for this long ends [s]: three periods of the oscillators.

    Raises:
        RunError: a value is out of range.
    """

    largest: int = 5
    seed: int = 0
    population_size: int = 6
    generations: tuple[int, ...] = (4,)
    exam_trials: int = 4
    duration: float = 12.0
    stuck_time: float = 3.0

    def __post_init__(self) -> None:
        coerce_integers(self, {"largest": (1, LARGEST), "seed": (0, MAX_SEED)}, RunError)
        coerce_floats(self, dict.fromkeys(("duration", "stuck_time"), (MIN_POSITIVE, _LONGEST)), RunError)
        _ = self.learning

    @property
    def learning(self) -> LearningConfig:
        """What each body learns."""
        return LearningConfig(
            population_size=self.population_size, rungs=self.generations, exam_trials=self.exam_trials
        )


def make_search(
    config: LandscapeConfig, name: str, arena: Path | str, folder: Path | None = None, workers: int = 1
) -> BodyEvolutionConfig:
    """Return the exhaustive search of one task; its results do not depend on the folder or the workers.

    Args:
        config: of the landscape.
        name: one of `TASKS`, `HELD_OUT_TASKS` and `SECOND_HELD_OUT_TASKS`.
        arena: folder of the arena.
        folder: folder of the run; None keeps it in memory.
        workers: number of threads.

    Raises:
        RunError: there is no such task.
    """
    tasks = {**TASKS, **HELD_OUT_TASKS, **SECOND_HELD_OUT_TASKS}
    if name not in tasks:
        raise RunError(f"no task {name!r}; there are: {', '.join(tasks)}")
    return BodyEvolutionConfig(
        arena=str(arena),
        seed=config.seed,
        track_control="skid",
        duration=config.duration,
        randomization=Randomization(stretch=(1.0,)),
        rollout=RolloutConfig(stuck_time=config.stuck_time),
        bodies=BodiesConfig(algorithm="exhaustive", largest=config.largest, children=CHILDREN),
        learning=config.learning,
        iterations=0,
        workers=workers,
        folder=None if folder is None else str(folder),
        **tasks[name],
    )
