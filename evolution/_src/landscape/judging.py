"""What bodies have learned, tried again: on the scan under other conditions, and in the truth, which only judges."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evolution._src.backends.making import Backend, make_backend
from evolution._src.backends.scoring import compute_fitness
from evolution._src.backends.simulation import Simulate
from evolution._src.backends.trials import Job
from evolution._src.body_search.config import BodyEvolutionConfig
from evolution._src.body_search.learner import EXAM
from evolution._src.body_search.learning import Lesson
from evolution._src.body_search.run import BodyRun
from evolution._src.landscape.config import CHILDREN, LandscapeConfig, make_search
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.typed_json import read_json

AGAIN = 2
"""A kind of trials with conditions that are neither those of learning nor those of the exam."""

KINDS = ("truth", "again")


class Judgment(NamedTuple):
    """How a learned genotype fared.

    Attributes:
        fitness: mean over trials.
        successes: successful trials.
    """

    fitness: float
    successes: int


def judge_bodies(
    config: LandscapeConfig,
    runs: dict[str, BodyRun],
    truths: dict[str, Path],
    folder: Path,
    workers: int = 1,
    simulate: Simulate | None = None,
    progress: Progress = silent,
    kinds: Sequence[str] = KINDS,
) -> dict[str, dict[str, list[Judgment]]]:
    """Try what each body has learned again, on the scan ("again") and in the truth ("truth").

    Args:
        config: of the landscape.
        runs: what bodies have learned, by task.
        truths: folder of the exact arena of each task.
        folder: where what is known is kept.
        workers: number of threads.
        simulate: the function that tries jobs; None means physics.
        progress: called with what is being done and the share done.
        kinds: "truth" and "again", or one of them; what is left out is unknown in the table.

    Returns:
        Task -> kind of trials -> judgments in the order of the lessons.
    """
    backend = make_backend("batch", workers, simulate=simulate)
    judged: dict[str, dict[str, list[Judgment]]] = {}
    try:
        for number, (name, run) in enumerate(runs.items()):
            path, learned = folder / f"{name}-judged.json", find_learned(run)
            known = _read(path, run)
            in_truth = make_search(config, name, truths[name])
            for kind, search, conditions in (
                ("truth", in_truth, (EXAM, len(config.generations) - 1)),
                ("again", run.config, (AGAIN, 0)),
            ):
                if kind not in kinds:
                    continue
                done = known.setdefault(kind, [])
                while len(done) < len(learned):
                    chunk = learned[len(done) : len(done) + CHILDREN]
                    done += try_again(backend, search, chunk, conditions, config.exam_trials)
                    _write(path, run, known)
                    progress(f"{name}, {kind}: {len(done)} of {len(learned)}", number / len(runs))
            judged[name] = {kind: known[kind] for kind in kinds}
    finally:
        backend.close()
    return judged


def find_learned(run: BodyRun) -> list[Lesson]:
    """Return the last lesson of each body, in the order of the run."""
    last = len(run.config.learning.rungs) - 1
    return [lesson for lesson in run.record.lessons if lesson.rung == last]


def try_again(
    backend: Backend,
    search: BodyEvolutionConfig,
    lessons: Sequence[Lesson],
    conditions: tuple[int, ...],
    count: int,
) -> list[Judgment]:
    """Return how learned genotypes fare.

    Args:
        backend: runs the trials.
        search: configuration of the trials, and where they take place.
        lessons: with the genotypes.
        conditions: seed of the conditions, in the run.
        count: trials of each.
    """
    jobs = [
        Job(np.array(lesson.genotype), search.make_trials(lesson.pupil.body, count, conditions))
        for lesson in lessons
    ]
    bodies = [search.make_organism(lesson.pupil.body) for lesson in lessons]
    return [
        Judgment(compute_fitness(search.scoring, outcome, body), outcome.successes)
        for outcome, body in zip(backend.run(jobs), bodies, strict=True)
    ]


def _read(path: Path, run: BodyRun) -> dict[str, list[Judgment]]:
    """Return what is known; nothing where it is of another run."""
    if not path.is_file():
        return {}
    content = read_json(path)
    if content.get("digest") != run.config.digest():
        return {}
    return {kind: [Judgment(*each) for each in values] for kind, values in content["judged"].items()}


def _write(path: Path, run: BodyRun, judged: dict[str, list[Judgment]]) -> None:
    content = {"digest": run.config.digest(), "judged": judged}
    with write_atomically(path) as temporary:
        temporary.write_text(json.dumps(content), encoding="utf-8")
