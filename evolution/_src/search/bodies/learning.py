"""What bodies learn within their lifetimes: CMA-ES over the genes of their controllers, in levels of growing budgets.

Every number depends on the seed of the run, the body and where its learning begins, and on nothing else: not on the
other bodies of the run, their order or the workers.

References:
    Eiben, Hart (2020), If it evolves it needs to learn, GECCO Companion.
    Jamieson, Talwalkar (2016), Non-stochastic best arm identification and hyperparameter optimization, AISTATS:
    successive halving, whose levels these are.
"""

import hashlib
from collections.abc import Sequence
from math import inf
from pathlib import Path

import numpy as np
from jaxtyping import Float

from evolution._src.backends.settings import MAX_ENVIRONMENTS
from evolution._src.backends.trials import Job
from evolution._src.search.bodies.algorithms import Assignment, LevelResult, make_algorithm
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.genome import BodyGenome
from evolution._src.search.bodies.run import BodyRun, make_body_run
from evolution._src.search.cmaes import Strategy
from evolution._src.search.record import EXAM, SAMPLE, Attempt, Entry, Record, Try


class Learning:
    """The learning of one body in progress."""

    def __init__(self, body: BodyGenome, config: BodyEvolutionConfig) -> None:
        controller = config.make_controller(config.make_organism(body))
        self.body, self.names = body, controller.parameters
        self.curve: list[float] = []  # best fitness of each generation
        zero = np.zeros(len(self.names))
        start = np.asarray(controller.initial if config.origin == "hint" else zero, dtype=float)
        self.best: Float[np.ndarray, " G"] = np.clip(start, controller.lower, controller.upper)
        self.best_fitness = -inf
        self.seconds = 0.0  # simulated since the last level [s]
        self._strategy: Strategy | None = None
        if self.names:
            digest = hashlib.sha256(f"{config.seed};{body.canonical_text}".encode()).digest()
            seed, rules = int.from_bytes(digest[:4], "little"), config.learning
            self._strategy = Strategy(controller, self.best, rules.sigma, rules.population_size, seed)

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Return the next generation.

        The first one is the start alone, of which the strategy is not told: CMA-ES samples around it only, and a row
        of modules may cross a pit without any control.
        """
        if self._strategy is None or not self.curve:
            return self.best[None]
        return self._strategy.ask()

    def tell(self, genotypes: Float[np.ndarray, "P G"], fitness: Float[np.ndarray, " P"]) -> None:
        """Take the fitness of a generation."""
        if self._strategy is not None and self.curve:
            self._strategy.tell(genotypes, fitness)
        index = int(np.argmax(fitness))
        self.curve.append(float(fitness[index]))
        if fitness[index] > self.best_fitness:
            self.best_fitness, self.best = float(fitness[index]), np.array(genotypes[index])


class Learner:
    """Lets bodies learn, chunks of them side by side."""

    def __init__(self, config: BodyEvolutionConfig) -> None:
        self._config = config
        self.results: dict[tuple[str, int], LevelResult] = {}
        self.due = 0
        self._told: dict[str, list[np.ndarray]] = {}  # Fitness of each generation of each body

    def learn(self, assignments: Sequence[Assignment], tries: Try) -> list[LevelResult]:
        """Let each body learn to the end of its level, where it has not yet, and return what it knows then."""
        missing: dict[str, Assignment] = {}
        for each in assignments:
            key = each.body.canonical_text
            if (key, each.level) not in self.results:
                missing[key] = max(missing.get(key, each), each, key=lambda one: one.level)
        self.due = sum(
            self._config.learning.count_trials(level)
            for key, each in missing.items()
            for level in range(each.level + 1)
            if (key, level) not in self.results
        )
        waiting = list(missing.values())
        for first in range(0, len(waiting), MAX_ENVIRONMENTS):
            self._teach(waiting[first : first + MAX_ENVIRONMENTS], tries)
        return [self.results[each.body.canonical_text, each.level] for each in assignments]

    def _teach(self, chunk: Sequence[Assignment], tries: Try) -> None:
        """Let some bodies learn side by side, a generation of each at a time."""
        learnings = {each.body.canonical_text: self._continue(each.body) for each in chunk}
        goals = {each.body.canonical_text: each.level for each in chunk}
        for level, end in enumerate(self._config.learning.levels):
            current = [
                learning
                for key, learning in learnings.items()
                if level <= goals[key] and (key, level) not in self.results
            ]
            if not current:
                continue
            while waiting := [learning for learning in current if len(learning.curve) < end]:
                self._step(waiting, tries)
            exams: Sequence[Entry | None] = [None] * len(current)
            if self._config.learning.has_exam(level):
                exams = self._try(current, [each.best[None] for each in current], EXAM, level, tries)
            for learning, exam in zip(current, exams, strict=True):
                result = _sum_up(learning, level, exam)
                self.results[learning.body.canonical_text, level] = result
                learning.seconds = 0.0

    def _continue(self, body: BodyGenome) -> Learning:
        """Return the learning of a body as it stands after its last level."""
        learning = Learning(body, self._config)
        for fitness in self._told.get(body.canonical_text, ()):
            learning.tell(learning.ask(), fitness)
        return learning

    def _step(self, learnings: Sequence[Learning], tries: Try) -> None:
        """Try a generation of each; all of them have come equally far, or begin."""
        asked = [learning.ask() for learning in learnings]
        entries = iter(self._try(learnings, asked, SAMPLE, None, tries))
        for learning, genotypes in zip(learnings, asked, strict=True):
            own = [next(entries) for _ in genotypes]
            fitness = np.array([entry.fitness for entry in own])
            learning.tell(genotypes, fitness)
            learning.seconds += sum(entry.outcome.seconds for entry in own)
            self._told.setdefault(learning.body.canonical_text, []).append(fitness)

    def _try(
        self,
        learnings: Sequence[Learning],
        asked: Sequence[Float[np.ndarray, "P G"]],
        kind: int,
        level: int | None,
        tries: Try,
    ) -> list[Entry]:
        """Try genotypes of several bodies under conditions of an exam's level, or of each body's own generation."""
        rules, attempts = self._config.learning, []
        for learning, genotypes in zip(learnings, asked, strict=True):
            index = len(learning.curve) if level is None else level
            count = rules.exam_trials if kind == EXAM else rules.trials
            trials = self._config.make_trials(learning.body, count, (kind, index))
            text = learning.body.text
            attempts += [Attempt(kind, index, Job(genes, trials), text) for genes in genotypes]
        return tries(attempts)


def _sum_up(learning: Learning, level: int, exam: Entry | None) -> LevelResult:
    """Return what a body has learned at the end of a level."""
    outcome = exam and exam.outcome
    return LevelResult(
        body=learning.body,
        level=level,
        fitness=exam.fitness if exam else learning.best_fitness,
        successes=outcome.successes if outcome else 0,
        trials=outcome.trials if outcome else 0,
        effort=outcome.effort if outcome else 0.0,
        genotype=tuple(learning.best.tolist()),
        names=learning.names,
        curve=tuple(learning.curve),
        seconds=learning.seconds + (outcome.seconds if outcome else 0.0),
    )


class BodySearch:
    """The search for bodies that learn, an iteration at a time."""

    def __init__(self, config: BodyEvolutionConfig) -> None:
        self._config, self._algorithm, self._learner = config, make_algorithm(config), Learner(config)

    @property
    def due(self) -> int:
        """Trials of the iteration that is running."""
        return self._learner.due

    def step(self, generation: int, tries: Try) -> dict[str, float]:
        """Ask for bodies and let them learn; return columns of the history, nothing where no body is left."""
        assignments = self._algorithm.ask()
        if not assignments:
            return {}
        results = self._learner.learn(assignments, tries)
        self._algorithm.tell(results)
        last = self._config.learning.last
        complete = [each.fitness for each in self._learner.results.values() if each.level == last]
        return {
            "population_size": len({each.body.canonical_text for each in results}),
            "restarts": 0,
            "best": max(complete, default=-inf),
            "median": float(np.median([each.fitness for each in results])),
            "sigma": 0.0,
            "validated": 0,
        }

    def make_run(self, record: Record, folder: Path | None) -> BodyRun:
        """Return the state of the run."""
        return make_body_run(self._config, record, tuple(self._learner.results.values()), folder)
