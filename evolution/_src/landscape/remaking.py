"""Some bodies of a published landscape again: their numbers have to be the same to the bit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evolution._src.backends.making import make_backend
from evolution._src.backends.simulation import Simulate
from evolution._src.body_search.learner import EXAM, Assignment, Learner
from evolution._src.body_search.learning import Lesson, Pupil
from evolution._src.body_search.record import BodyRecord
from evolution._src.errors import RunError
from evolution._src.landscape.config import make_search
from evolution._src.landscape.judging import AGAIN, Judgment, try_again
from evolution._src.landscape.table import Landscape


def draw_places(table: Landscape, count: int, seed: int = 0) -> list[int]:
    """Return the places of some random bodies of a landscape, in its order.

    Raises:
        RunError: it has fewer bodies.
    """
    if not 1 <= count <= len(table.bodies):
        raise RunError(f"count is {count}; the landscape has {len(table.bodies)} bodies")
    return sorted(np.random.default_rng(seed).choice(len(table.bodies), count, replace=False).tolist())


def find_differences(
    table: Landscape,
    name: str,
    arena: Path | str,
    truth: Path | str,
    places: Sequence[int],
    workers: int = 1,
    simulate: Simulate | None = None,
) -> dict[int, tuple[str, ...]]:
    """Let some bodies learn and be judged again, and return the arrays of the table in which they differ.

    Args:
        table: the landscape.
        name: of the task.
        arena: folder of its scanned arena.
        truth: folder of its exact arena.
        places: of the bodies in the table.
        workers: number of threads.
        simulate: the function that tries jobs; None means physics.

    Returns:
        Place -> names of arrays of the table; no name where all bits are equal.
    """
    task = table.find_task(name)
    scanned, exact = (make_search(table.config, name, each) for each in (arena, truth))
    last = len(scanned.learning.rungs) - 1
    backend = make_backend("batch", workers, simulate=simulate)
    try:
        learner = Learner(scanned, BodyRecord(), backend)
        lessons = learner.learn([Assignment(Pupil(table.bodies[place]), last) for place in places])
        trials = table.config.exam_trials
        truths = try_again(backend, exact, lessons, (EXAM, last), trials)
        agains = try_again(backend, scanned, lessons, (AGAIN, 0), trials)
    finally:
        backend.close()
    found = {}
    for place, lesson, *judged in zip(places, lessons, truths, agains, strict=True):
        made = _describe(lesson, *judged)
        found[place] = tuple(
            key for key, value in made.items() if not np.array_equal(_look_up(table, key, task, place), value)
        )
    return found


def _describe(lesson: Lesson, truth: Judgment, again: Judgment) -> dict[str, Any]:
    """Return what the table has of a body and a task, by the names of its arrays."""
    return {
        "fitness": lesson.fitness,
        "successes": lesson.successes,
        "seconds": lesson.seconds,
        "effort": lesson.effort,
        "curve": lesson.curve,
        "genotypes": lesson.genotype,
        "again_fitness": again.fitness,
        "again_successes": again.successes,
        "truth_fitness": truth.fitness,
        "truth_successes": truth.successes,
    }


def _look_up(table: Landscape, key: str, task: int, place: int) -> Any:
    if key == "genotypes":
        return table.find_genotype(task, place)
    return getattr(table, key)[task, place]
