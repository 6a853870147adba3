"""What every baseline may do: try genotypes in the scanned arena until its budget is spent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from evolution._src.backends.making import Backend
from evolution._src.backends.outcome import Outcome
from evolution._src.backends.trials import Job, find_trial_controller
from evolution._src.bodies.variation import BodyLimits, make_random_body
from evolution._src.controllers.protocol import Controller
from evolution._src.suite.submission import SCORING
from evolution._src.suite.tasks import EXAM_SEED, LARGEST, SuiteTask
from symbrion_gym._src.robot.organism import Organism

CONTROLLER = "oscillators"
"""The law of these baselines: it fits any body."""
POPULATION = 8
"""Genotypes of a generation."""
SIGMA = 0.5
"""Initial step size of CMA-ES, and spread of random genotypes."""


class Found(NamedTuple):
    """The best genotype so far.

    Attributes:
        fitness: of its best trial while learning.
        body: its body.
        genotype: its genes.
    """

    fitness: float
    body: Organism
    genotype: Float[np.ndarray, " G"]


class Practice:
    """A task, a budget and the best genotype that was tried.

    Each generation has conditions of its own, equal for its genotypes. A generation that has begun is finished.

    Args:
        task: what is to be learned.
        backend: runs the trials.
        budget: simulated time that may be spent [s].
        descriptors: what outcomes keep beside progress, see `evolution._src.backends.descriptors`.
    """

    def __init__(
        self, task: SuiteTask, backend: Backend, budget: float, descriptors: tuple[str, ...] = ()
    ) -> None:
        self.task, self.backend, self.budget, self._descriptors = task, backend, budget, descriptors
        self.seconds, self.generation = 0.0, 0
        self.best: Found | None = None

    def has_time(self, share: float = 1.0) -> bool:
        """Return whether less than a share of the budget is spent."""
        return self.seconds < share * self.budget

    def run(self, body: Organism, genotypes: Float[np.ndarray, "P G"]) -> list[Outcome]:
        """Try each genotype once, keep the best, and return the outcomes."""
        self.generation += 1  # from 1: a seed that ends in 0 would be that of the exam
        seed = (*EXAM_SEED, self.generation)
        trials = self.task.make_trials(body, CONTROLLER, 1, seed, descriptors=self._descriptors)
        outcomes = self.backend.run([Job(genotype, trials) for genotype in genotypes])
        self.seconds += sum(outcome.seconds for outcome in outcomes)
        self.offer(body, genotypes, score_all(outcomes))
        return outcomes

    def try_all(self, body: Organism, genotypes: Float[np.ndarray, "P G"]) -> Float[np.ndarray, " P"]:
        """Try each genotype once, and return the fitness of each."""
        return score_all(self.run(body, genotypes))

    def offer(
        self, body: Organism, genotypes: Float[np.ndarray, "P G"], fitness: Float[np.ndarray, " P"]
    ) -> None:
        """Keep the best genotype if it is better than the one that is kept."""
        index = int(np.argmax(fitness))
        if self.best is None or fitness[index] > self.best.fitness:
            self.best = Found(float(fitness[index]), body, np.array(genotypes[index]))


Baseline: TypeAlias = Callable[[Practice, np.random.Generator], None]
"""Spends the budget of a practice, which keeps the best genotype."""


def score_all(outcomes: Sequence[Outcome]) -> Float[np.ndarray, " P"]:
    """Return the fitness of each outcome."""
    return np.array([SCORING.score(outcome, 0) for outcome in outcomes])


def draw_body(task: SuiteTask, rng: np.random.Generator) -> Organism:
    """Return the body of a task; a random one where it is free."""
    from evolution._src.backends.parts import read_organism

    if task.body is not None:
        return read_organism(task.body)
    return make_random_body(rng, BodyLimits(1, LARGEST)).to_organism()


def find_law(task: SuiteTask, body: Organism) -> Controller:
    """Return the controller of a body."""
    return find_trial_controller(task.make_trials(body, CONTROLLER, 1, EXAM_SEED))


def draw_genotypes(
    rng: np.random.Generator, law: Controller, count: int = POPULATION
) -> Float[np.ndarray, "P G"]:
    """Return random genotypes around zero."""
    return np.clip(rng.normal(0.0, SIGMA, (count, len(law.parameters))), law.lower, law.upper)
