"""The baselines of the benchmark suite: doing nothing, drawing at random, CMA-ES, and searches for bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from evolution.backends.making import Backend
from evolution.backends.trials import Job, find_trial_controller
from evolution.bodies.variation import BodyLimits, make_random_body
from evolution.controllers.protocol import Controller
from evolution.search.cmaes import Space, Strategy
from evolution.suite.submission import SCORING, Entry, find_score
from evolution.suite.tasks import BUDGET, EXAM_SEED, LARGEST, SuiteTask
from symbrion_gym.robot.body_plans import organism_to_text
from symbrion_gym.robot.organism import Organism

CONTROLLER = "oscillators"
"""The law of all baselines: it fits any body."""
POPULATION = 8
SIGMA = 0.5
"""Initial step size of CMA-ES, and spread of random genotypes."""
BODIES_DRAWN = 8
"""Bodies that CMA-ES shares its budget between, where the body is free; random search draws one with each genotype."""
RESTING_BODY = 3
"""Modules in a row, where the body is free and nothing is searched."""
METHODS = ("zero", "random", "cmaes")


class Found(NamedTuple):
    """The best genotype of a body so far.

    Attributes:
        fitness: of its best trial while learning; -inf before the first.
        body: its body.
        genotype: its genes.
        seconds: simulated for it [s].
    """

    fitness: float
    body: Organism
    genotype: Float[np.ndarray, " G"]
    seconds: float


def run_baseline(method: str, task: SuiteTask, seed: int, backend: Backend, budget: float = BUDGET) -> Entry:
    """Return what a baseline finds for a task.

    Args:
        method: one of `METHODS`.
        task: the task.
        seed: seed of the method.
        backend: runs the trials.
        budget: simulated time that it may spend [s]; a generation that has begun is finished.
    """
    rng = np.random.default_rng((seed, *task.name.encode(), *method.encode()))
    found = {"zero": _do_nothing, "random": _draw, "cmaes": _evolve}[method](task, rng, backend, budget)
    plan = organism_to_text(found.body)
    scan, truth = (
        find_score(task, plan, CONTROLLER, found.genotype, in_truth, backend) for in_truth in (False, True)
    )
    genes = tuple(float(gene) for gene in found.genotype)
    return Entry(task.name, seed, plan, CONTROLLER, genes, found.seconds, scan, truth)


def _do_nothing(task: SuiteTask, rng: np.random.Generator, backend: Backend, budget: float) -> Found:
    from evolution.backends.parts import read_organism

    body = read_organism(RESTING_BODY if task.body is None else task.body)
    return Found(0.0, body, np.zeros(len(_find_controller(task, body).parameters)), 0.0)


def _draw(task: SuiteTask, rng: np.random.Generator, backend: Backend, budget: float) -> Found:
    """Draw genotypes around zero, and a body with each generation where it is free; keep the best trial."""
    best, spent, generation = None, 0.0, 0
    while best is None or spent < budget:
        body = _draw_body(task, rng)
        controller = _find_controller(task, body)
        genotypes = rng.normal(0.0, SIGMA, (POPULATION, len(controller.parameters)))
        genotypes = np.clip(genotypes, controller.lower, controller.upper)
        fitness, seconds = _try(task, body, genotypes, generation, backend)
        spent, generation = spent + seconds, generation + 1
        best = _choose(best, fitness, body, genotypes)
    return best._replace(seconds=spent)


def _evolve(task: SuiteTask, rng: np.random.Generator, backend: Backend, budget: float) -> Found:
    """Let CMA-ES learn, of several random bodies one after the other where the body is free."""
    count = BODIES_DRAWN if task.body is None else 1
    best, spent = None, 0.0
    for number in range(count):
        body = _draw_body(task, rng)
        controller = _find_controller(task, body)
        strategy = _make_strategy(controller, int(rng.integers(2**31)))
        generation = 0
        while best is None or spent < budget * (number + 1) / count:
            genotypes = strategy.ask()
            fitness, seconds = _try(task, body, genotypes, generation, backend)
            strategy.tell(genotypes, np.array(fitness))
            spent, generation = spent + seconds, generation + 1
            best = _choose(best, fitness, body, genotypes)
    assert best is not None
    return best._replace(seconds=spent)


def _try(
    task: SuiteTask, body: Organism, genotypes: Float[np.ndarray, "P G"], generation: int, backend: Backend
) -> tuple[list[float], float]:
    """Return the fitness of each genotype in one trial, and the simulated time [s]."""
    trials = task.make_trials(body, CONTROLLER, 1, (*EXAM_SEED, generation))
    outcomes = backend.run([Job(genotype, trials) for genotype in genotypes])
    fitness = [SCORING.score(outcome, 0) for outcome in outcomes]
    return fitness, sum(outcome.seconds for outcome in outcomes)


def _choose(
    best: Found | None, fitness: Sequence[float], body: Organism, genotypes: Float[np.ndarray, "P G"]
) -> Found:
    index = int(np.argmax(fitness))
    if best is None or fitness[index] > best.fitness:
        return Found(fitness[index], body, np.array(genotypes[index]), 0.0)
    return best


def _draw_body(task: SuiteTask, rng: np.random.Generator) -> Organism:
    from evolution.backends.parts import read_organism

    if task.body is not None:
        return read_organism(task.body)
    return make_random_body(rng, BodyLimits(1, LARGEST)).to_organism()


def _find_controller(task: SuiteTask, body: Any) -> Controller:
    return find_trial_controller(task.make_trials(body, CONTROLLER, 1, EXAM_SEED))


def _make_strategy(controller: Controller, seed: int) -> Strategy:
    count = len(controller.parameters)
    space = Space(
        names=controller.parameters,
        lower=controller.lower,
        upper=controller.upper,
        initial=(0.0,) * count,
        spread=(1.0,) * count,
    )
    return Strategy(space, SIGMA, POPULATION, seed)
