"""Searches for bodies replayed on the landscape: what a body learns is looked up, so that a run takes a moment.

A search proposes bodies of the sizes of the table alone and pays what learning cost, a share of it where a body learns
only the first generations. A body that was asked for before costs nothing, as in a real run.

What a lookup leaves out: every body of the table has learned once, with one seed, so that the noise of an exam is the
same in all replays of a task; and a child never inherits what its parent has learned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from evolution._src.body_search.algorithms.making import make_searcher
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import Lesson, Pupil
from evolution._src.errors import RunError
from evolution._src.landscape.table import Landscape

MAX_ITERATIONS = 2000
"""A search that only asks for what it knows ends after so many iterations."""


class Replay(NamedTuple):
    """A search on the landscape.

    Attributes:
        seconds: simulated after each iteration [s].
        best: fitness of the body that the search holds for the best then, on the scan.
        truth: fitness of that body in the truth.
    """

    seconds: Float[np.ndarray, " I"]
    best: Float[np.ndarray, " I"]
    truth: Float[np.ndarray, " I"]


class Table:
    """Answers the questions of a search from the landscape.

    Args:
        landscape: the table.
        task: name of the task.
        rungs: generations after which a body is examined; the table knows the last exam, and for an earlier rung
            the best fitness of learning up to there stands for it.
    """

    def __init__(self, landscape: Landscape, task: str, rungs: tuple[int, ...] | None = None) -> None:
        self._table, self._task = landscape, landscape.find_task(task)
        self.rungs = rungs or landscape.config.generations[-1:]
        if self.rungs[-1] != landscape.config.generations[-1]:
            raise RunError(
                f"rungs is {self.rungs}; the bodies of the landscape learn to generation "
                f"{landscape.config.generations[-1]}"
            )
        self._paid: dict[int, int] = {}
        self.seconds = 0.0

    def find_place(self, pupil: Pupil) -> int:
        """Return the place of a body.

        Raises:
            RunError: the landscape has no such body.
        """
        key = pupil.body.canonical_text
        if key not in self._table.index:
            raise RunError(f"the landscape has no body {key!r}; search bodies of up to "
                           f"{self._table.config.largest} modules")  # fmt: skip
        return self._table.index[key]

    def look_up(self, assignment: Assignment) -> Lesson:
        """Return what a body knows at the end of a rung, and pay for what is new of it."""
        place, rung = self.find_place(assignment.pupil), assignment.rung
        self._pay(place, self.rungs[rung])
        is_last = rung == len(self.rungs) - 1
        curve = self._table.curve[self._task, place]
        fitness = self._table.fitness[self._task, place] if is_last else curve[: self.rungs[rung]].max()
        return Lesson(
            pupil=assignment.pupil,
            rung=rung,
            fitness=float(fitness),
            successes=int(self._table.successes[self._task, place]) if is_last else 0,
            trials=self._table.config.exam_trials if is_last else 0,
            effort=float(self._table.effort[self._task, place]),
            genotype=self._table.find_genotype(self._task, place),
            names=self._table.gene_names[place],
            curve=tuple(curve[: self.rungs[rung]].tolist()),
            seconds=0.0,
        )

    def find_truth(self, pupil: Pupil) -> float:
        """Return the fitness of a body in the truth."""
        return float(self._table.truth_fitness[self._task, self.find_place(pupil)])

    def _pay(self, place: int, generations: int) -> None:
        """Count the share of the body's cost that these generations are, by their trials."""
        paid = self._paid.get(place, 0)
        if generations > paid:
            share = self._count_trials(generations) - self._count_trials(paid)
            whole = self._count_trials(self.rungs[-1])
            self.seconds += share / whole * float(self._table.seconds[self._task, place])
            self._paid[place] = generations

    def _count_trials(self, generations: int) -> int:
        """Return the trials of so many generations; the last one has the exam."""
        if not generations:
            return 0
        learning = self._table.config.learning
        if generations < learning.rungs[-1]:
            learning = replace(learning, rungs=(generations, learning.rungs[-1]), is_examined_early=False)
        return learning.count_trials(0)


def replay(
    landscape: Landscape,
    task: str,
    algorithm: str,
    seed: int,
    budget: float,
    bodies: BodiesConfig | None = None,
    rungs: tuple[int, ...] | None = None,
) -> Replay:
    """Replay a search until its budget is spent.

    Args:
        landscape: the table.
        task: name of the task.
        algorithm: a name of `evolution._src.body_search.config.ALGORITHMS`.
        seed: seed of the search.
        budget: simulated time at which it ends [s].
        bodies: parameters of the search; the largest body is that of the landscape.
        rungs: as in `Table`.

    Raises:
        RunError: an argument does not suit the landscape.
    """
    config = replace(bodies or BodiesConfig(), algorithm=algorithm, largest=landscape.config.largest)
    table = Table(landscape, task, rungs)
    learning = replace(landscape.config.learning, rungs=table.rungs, is_examined_early=False)
    searcher = make_searcher(config, learning, seed)
    seconds, best, truth = [0.0], [-np.inf], [-np.inf]
    champion: Lesson | None = None
    for _ in range(MAX_ITERATIONS):
        lessons = []
        for assignment in searcher.ask():
            lesson = table.look_up(assignment)
            if table.seconds > budget:
                break
            lessons.append(lesson)
            is_done = lesson.rung == len(table.rungs) - 1
            if is_done and (champion is None or lesson.fitness > champion.fitness):
                champion = lesson
                seconds.append(table.seconds)
                best.append(lesson.fitness)
                truth.append(table.find_truth(lesson.pupil))
        if table.seconds > budget or not lessons:
            break
        searcher.tell(lessons)
    return Replay(np.array(seconds), np.array(best), np.array(truth))


def measure_area(run: Replay, budget: float, lowest: float, highest: float) -> float:
    """Return the area under the curve of the best fitness over the budget, 0 to 1.

    Args:
        run: a replayed search.
        budget: where the curve ends [s].
        lowest: fitness that counts 0, as before the first body.
        highest: fitness that counts 1.
    """
    heights = np.clip((run.best - lowest) / (highest - lowest), 0.0, 1.0)
    ends = np.append(run.seconds[1:], budget)
    return float(np.sum(heights * (np.minimum(ends, budget) - np.minimum(run.seconds, budget))) / budget)


def summarize(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the mean and its 95 % interval (Student's t)."""
    from scipy import stats

    mean, spread = float(np.mean(values)), float(stats.sem(values))
    half = spread * float(stats.t.ppf(0.975, len(values) - 1))
    return mean, mean - half, mean + half
