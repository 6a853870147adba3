"""The baselines of the suite: doing nothing, chance, CMA-ES over genes, and the surrogate search for bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.pool import Simulate
from evolution._src.backends.settings import Randomization, read_organism
from evolution._src.backends.trials import Job, Trials, find_trial_controller
from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from evolution._src.search.bodies.algorithms import LevelResult, make_algorithm
from evolution._src.search.bodies.config import BodiesConfig, BodyEvolutionConfig, LearningConfig
from evolution._src.search.bodies.genome import make_random_body
from evolution._src.search.bodies.learning import Learner
from evolution._src.search.cmaes import Strategy
from evolution._src.search.evaluation import try_attempts
from evolution._src.search.record import Attempt
from evolution._src.search.record import Entry as Tried
from evolution._src.search.run import describe_origin
from evolution._src.suite.exam import SCORING
from evolution._src.suite.submission import Entry, Submission, fill_submission
from evolution._src.suite.tasks import BUDGET, LARGEST, SUITE, SuiteTask, find_suite_task
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.robot.body_plans import organism_to_text
from symbrion_gym._src.robot.organism import Organism

CONTROLLER = "oscillators"  # The law of these baselines: it fits any body
POPULATION = 8  # Genotypes of a generation
SIGMA = 0.5  # Initial step size of CMA-ES, and spread of random genotypes
LEARNING_SEED = 22  # Of the conditions while learning, with the number of the generation
BODIES_DRAWN = 4  # Random bodies that CMA-ES shares its budget between, where the body is free
LEARNING = LearningConfig(population_size=6, levels=(1, 2, 4), exam_trials=1, is_examined_early=False)
"""Of the bodies of the surrogate search; the first budget level is the zero genotype alone."""
CHILDREN, PARENTS = 4, 6  # Bodies of an iteration of the surrogate search, and parents


class Found(NamedTuple):
    """The best genotype so far."""

    fitness: float  # of its best trial while learning
    body: Organism  # its body
    genotype: Float[np.ndarray, " G"]  # its genes


class Practice:
    """A task, a budget of simulated time [s] and the best genotype that was tried in the scanned arena.

    Each generation has conditions of its own, equal for its genotypes. A generation that has begun is finished.
    """

    def __init__(self, task: SuiteTask, backend: Backend, budget: float) -> None:
        self.task, self.backend, self.budget = task, backend, budget
        self.seconds, self.generation = 0.0, 0
        self.best: Found | None = None

    def has_time(self, share: float = 1.0) -> bool:
        """Return whether less than a share of the budget is spent."""
        return self.seconds < share * self.budget

    def try_all(self, body: Organism, genotypes: Float[np.ndarray, "P G"]) -> Float[np.ndarray, " P"]:
        """Try each genotype once, keep the best, and return the fitness of each."""
        self.generation += 1
        trials = self._make_trials(body, (LEARNING_SEED, self.generation))
        outcomes = self.backend.run([Job(genotype, trials) for genotype in genotypes])
        self.seconds += sum(outcome.seconds for outcome in outcomes)
        fitness = np.array([SCORING.score(outcome, 0) for outcome in outcomes])
        self.offer(body, genotypes, fitness)
        return fitness

    def offer(
        self, body: Organism, genotypes: Float[np.ndarray, "P G"], fitness: Float[np.ndarray, " P"]
    ) -> None:
        """Keep the best genotype if it is better than the one that is kept."""
        index = int(np.argmax(fitness))
        if self.best is None or fitness[index] > self.best.fitness:
            self.best = Found(float(fitness[index]), body, np.array(genotypes[index]))

    def make_controller(self, body: Organism) -> Controller:
        """Return the controller of a body."""
        return find_trial_controller(self._make_trials(body, (LEARNING_SEED,)))

    def _make_trials(self, body: Organism, seed: tuple[int, ...]) -> Trials:
        return self.task.make_trials(self.task.find_scan(), body, CONTROLLER, 1, seed)

    def draw_body(self, rng: np.random.Generator) -> Organism:
        """Return the body of the task; a random one where it is free."""
        if self.task.body is not None:
            return read_organism(self.task.body)
        return make_random_body(rng, (1, LARGEST)).to_organism()


def _run_zero(practice: Practice, rng: np.random.Generator) -> None:
    """Try the zero genotype, tracks full speed ahead and hinges straight; with each row where the body is free."""
    rows = range(1, LARGEST + 1) if practice.task.body is None else [practice.task.body]
    for body in map(read_organism, rows):
        practice.try_all(body, np.zeros((1, len(practice.make_controller(body).parameters))))


def _run_random(practice: Practice, rng: np.random.Generator) -> None:
    """Draw genotypes around zero, and a body with each generation where it is free."""
    while practice.has_time():
        body = practice.draw_body(rng)
        law = practice.make_controller(body)
        genotypes = rng.normal(0.0, SIGMA, (POPULATION, len(law.parameters)))
        practice.try_all(body, np.clip(genotypes, law.lower, law.upper))


def _run_cmaes(practice: Practice, rng: np.random.Generator) -> None:
    """Let CMA-ES learn, of several random bodies one after the other where the body is free.

    The zero genotype is tried first: it drives straight ahead, and CMA-ES samples around it only, so that a small
    budget would end below a baseline that does nothing.
    """
    count = BODIES_DRAWN if practice.task.body is None else 1
    for number in range(count):
        body = practice.draw_body(rng)
        law = practice.make_controller(body)
        genes = len(law.parameters)
        strategy = Strategy(law, (0.0,) * genes, SIGMA, POPULATION, int(rng.integers(2**31)))
        practice.try_all(body, np.zeros((1, genes)))
        while practice.has_time((number + 1) / count):
            genotypes = strategy.ask()
            strategy.tell(genotypes, practice.try_all(body, genotypes))


def _run_surrogate(practice: Practice, rng: np.random.Generator) -> None:
    """Let the search of `symbrion evolve --bodies` propose bodies; the one that did best in its exam is kept."""
    config = BodyEvolutionConfig(
        arena=practice.task.find_scan(),
        seed=int(rng.integers(2**31)),
        controller=CONTROLLER,
        randomization=Randomization(stretch=(1.0,)),
        scoring=SCORING,
        bodies=BodiesConfig(
            algorithm="surrogate", largest=LARGEST, children=CHILDREN, population_size=PARENTS
        ),
        learning=LEARNING,
        **practice.task.make_options(),
    )

    def tries(attempts: Sequence[Attempt]) -> list[Tried]:
        tried = try_attempts(attempts, practice.backend, SCORING, 0)
        practice.seconds += sum(each.outcome.seconds for each in tried)
        return tried

    search, learner = make_algorithm(config), Learner(config)
    while practice.has_time():
        results: list[LevelResult] = []
        for assignment in search.ask():
            if not practice.has_time():
                return
            results += learner.learn([assignment], tries)
            last = results[-1]
            practice.offer(last.body.to_organism(), np.array([last.genotype]), np.array([last.fitness]))
        search.tell(results)


METHODS: Mapping[str, Callable[[Practice, np.random.Generator], None]] = {
    "zero": _run_zero,
    "random": _run_random,
    "cmaes": _run_cmaes,
    "surrogate": _run_surrogate,
}
"""Baselines by name: each spends the budget of a practice, which keeps the best genotype."""


def suits(method: str, task: SuiteTask) -> bool:
    """Return whether a baseline can run on a task: one that searches bodies only where the body is free."""
    check_choice("method", method, tuple(METHODS), RunError)
    return task.body is None or method != "surrogate"


def run_baseline(name: str, task: SuiteTask, seed: int, backend: Backend, budget: float = BUDGET) -> Entry:
    """Return what a baseline finds for a task."""
    if not suits(name, task):
        raise RunError(
            f"the baseline {name!r} searches bodies, and {task.name!r} gives one; leave the task out"
        )
    practice = Practice(task, backend, budget)
    METHODS[name](practice, np.random.default_rng((seed, *task.name.encode(), *name.encode())))
    found = practice.best
    assert found is not None
    genes = tuple(float(gene) for gene in found.genotype)
    return Entry(task.name, seed, organism_to_text(found.body), CONTROLLER, genes, practice.seconds)


def run_suite(
    method: str,
    seeds: Sequence[int],
    tasks: Sequence[str] = (),
    budget: float = BUDGET,
    workers: int = 1,
    progress: Progress = silent,
    simulate: Simulate | None = None,
    out: Path | None = None,
) -> Submission:
    """Return what a baseline finds for tasks, all that it suits unless some are named."""
    suited = [task for task in SUITE if suits(method, task)]
    chosen = [find_suite_task(name) for name in tasks] or suited
    backend = make_backend("batch", workers, simulate=simulate)
    try:
        return fill_submission(
            method if budget == BUDGET else f"{method}, {budget:g} s",
            lambda task, seed: run_baseline(method, task, seed, backend, budget),
            [(task, seed) for seed in seeds for task in chosen],
            describe_origin() | {"method": method, "budget": budget},
            out,
            progress,
        )
    finally:
        backend.close()
