"""Learning of many bodies on a backend: chunks of bodies side by side, and what is recorded is not tried again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from evolution._src.backends.cluster import LOCAL_BACKENDS, Backend
from evolution._src.backends.outcome import Outcome, check_tried
from evolution._src.backends.scoring import compute_fitness
from evolution._src.backends.trials import Job
from evolution._src.errors import RunError
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.learning import BodyGenome, Learning, LevelResult
from evolution._src.search.bodies.record import BodyRecord

LEARNING, EXAM = 0, 1  # Kinds of trials, each with conditions of its own


class Tried(NamedTuple):
    """How far assignments have come."""

    trials: int  # tried so far
    due: int  # trials of all of them
    seconds: float  # simulated so far [s]


OnTried = Callable[[Tried], None]


class Assignment(NamedTuple):
    """A body, and the level to which it shall learn."""

    body: BodyGenome  # the body and where it begins
    level: int  # index of the level


class Learner:
    """Let bodies learn.

    Args:
        config: configuration of the run.
        record: what is known; results are added to it.
        backend: runs the trials; None where all is recorded.
    """

    def __init__(self, config: BodyEvolutionConfig, record: BodyRecord, backend: Backend | None) -> None:
        self._config, self._record, self._backend = config, record, backend
        self._on_tried: OnTried | None = None
        self._tried = Tried(0, 0, 0.0)

    def knows(self, assignments: Sequence[Assignment]) -> bool:
        """Return whether all of it is recorded."""
        return all(
            self._record.find(each.body.canonical_text, each.level) is not None for each in assignments
        )

    def learn(self, assignments: Sequence[Assignment], on_tried: OnTried | None = None) -> list[LevelResult]:
        """Let each body learn to the end of its level, where it has not yet, and return what it knows then."""
        missing: dict[str, Assignment] = {}
        for each in assignments:
            if self._record.find(each.body.canonical_text, each.level) is None:
                known = missing.get(each.body.canonical_text, each)
                missing[each.body.canonical_text] = max(known, each, key=lambda one: one.level)
        if missing and self._backend is None:
            raise RunError("a search that is only read tries nothing")
        self._on_tried, self._tried = on_tried, Tried(0, self._count_due(list(missing.values())), 0.0)
        for chunk in _split(list(missing.values()), self._config.rollout.max_environments):
            self._teach(chunk)
        results = [self._record.find(each.body.canonical_text, each.level) for each in assignments]
        return [result for result in results if result is not None]

    def _count_due(self, assignments: Sequence[Assignment]) -> int:
        """Return how many trials are not recorded."""
        return sum(
            self._config.learning.count_trials(level)
            for each in assignments
            for level in range(each.level + 1)
            if self._record.find(each.body.canonical_text, level) is None
        )

    def _teach(self, chunk: Sequence[Assignment]) -> None:
        """Let some bodies learn side by side, a generation of each at a time."""
        learnings = [self._continue(each.body) for each in chunk]
        for level, end in enumerate(self._config.learning.levels):
            current = [
                learning
                for each, learning in zip(chunk, learnings, strict=True)
                if level <= each.level and self._record.find(each.body.canonical_text, level) is None
            ]
            seconds = dict.fromkeys((learning.body.canonical_text for learning in current), 0.0)
            while any(learning.generation < end for learning in current):
                self._step([learning for learning in current if learning.generation < end], seconds)
            if self._config.learning.is_examined_early or level == len(self._config.learning.levels) - 1:
                self._examine(current, level, seconds)
            else:
                self._pass_on(current, level, seconds)

    def _continue(self, body: BodyGenome) -> Learning:
        """Return the learning of a body as it stands after its last recorded level."""
        organism = self._config.make_organism(body)
        controller = self._config.make_controller(organism)
        learning = Learning(body, controller, self._config.learning, self._config.origin, self._config.seed)
        for generation in self._record.find_generations(body.canonical_text):
            learning.tell(learning.ask(), np.array(generation))
        return learning

    def _step(self, learnings: Sequence[Learning], seconds: dict[str, float]) -> None:
        """Try a generation of each."""
        asked = [learning.ask() for learning in learnings]
        jobs = []
        for learning, genotypes in zip(learnings, asked, strict=True):
            conditions = (LEARNING, learning.generation)
            trials = self._config.make_trials(learning.body, self._config.learning.trials, conditions)
            jobs += [Job(genotype, trials) for genotype in genotypes]
        outcomes = iter(self._run(jobs))
        for learning, genotypes in zip(learnings, asked, strict=True):
            own = [next(outcomes) for _ in genotypes]
            fitness = self._score(learning.body, own)
            learning.tell(genotypes, np.array(fitness))
            self._record.add_generation(learning.body.canonical_text, fitness)
            seconds[learning.body.canonical_text] += sum(outcome.seconds for outcome in own)

    def _examine(self, learnings: Sequence[Learning], level: int, seconds: dict[str, float]) -> None:
        """Try the best genotype of each under conditions that are not those of its learning, and record the results."""
        count = self._config.learning.exam_trials
        trials = [self._config.make_trials(each.body, count, (EXAM, level)) for each in learnings]
        jobs = [Job(learning.best, own) for learning, own in zip(learnings, trials, strict=True)]
        for learning, outcome in zip(learnings, self._run(jobs), strict=True):
            key = learning.body.canonical_text
            passed = _sum_up(learning, level, seconds[key])
            result = passed._replace(
                fitness=self._score(learning.body, [outcome])[0],
                successes=outcome.successes,
                trials=outcome.trials,
                effort=outcome.effort,
                seconds=passed.seconds + outcome.seconds,
            )
            self._record.add_result(result)

    def _pass_on(self, learnings: Sequence[Learning], level: int, seconds: dict[str, float]) -> None:
        """Record what each has learned, without an exam."""
        for learning in learnings:
            self._record.add_result(_sum_up(learning, level, seconds[learning.body.canonical_text]))

    def _run(self, jobs: Sequence[Job]) -> list[Outcome]:
        assert self._backend is not None
        outcomes: list[Outcome] = []
        for part in self._divide(jobs):
            tried = self._backend.run(part)
            self._report(tried)
            outcomes += tried
        if outcomes and not self._record.num_results:  # later on, a body may be to blame
            check_tried(outcomes)
        return outcomes

    def _divide(self, jobs: Sequence[Job]) -> list[Sequence[Job]]:
        """Return the jobs of each body where this process runs one after the other anyway, and progress is shown."""
        if self._on_tried is None or self._config.backend not in LOCAL_BACKENDS:
            return [jobs]
        return [list(part) for _, part in groupby(jobs, key=lambda job: job.trials.organism)]

    def _report(self, outcomes: Sequence[Outcome]) -> None:
        """Count further trials, and report them where that is wanted."""
        trials = self._tried.trials + sum(outcome.trials for outcome in outcomes)
        seconds = self._tried.seconds + sum(outcome.seconds for outcome in outcomes)
        self._tried = Tried(trials, max(self._tried.due, trials), seconds)
        if self._on_tried is not None:
            self._on_tried(self._tried)

    def _score(self, body: BodyGenome, outcomes: Sequence[Outcome]) -> list[float]:
        organism = self._config.make_organism(body)
        return [compute_fitness(self._config.scoring, outcome, organism) for outcome in outcomes]


def _sum_up(learning: Learning, level: int, seconds: float) -> LevelResult:
    """Return what a body has learned, before an exam."""
    return LevelResult(
        body=learning.body,
        level=level,
        fitness=learning.best_fitness,
        successes=0,
        trials=0,
        effort=0.0,
        genotype=tuple(learning.best.tolist()),
        names=learning.controller.parameters,
        curve=tuple(learning.curve),
        seconds=seconds,
    )


def _split(assignments: list[Assignment], size: int) -> Iterator[list[Assignment]]:
    """Yield chunks of assignments."""
    for begin in range(0, len(assignments), size):
        yield assignments[begin : begin + size]
