"""Baselines over the genes of a controller: CMA-ES, and a genetic algorithm for a given body.

Both try the zero genotype first: it drives straight ahead, and CMA-ES samples around it only, so that a small budget
would end below a baseline that does nothing.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from evolution._src.backends.parts import read_organism
from evolution._src.controllers.protocol import Controller
from evolution._src.search.cmaes import Space, Strategy
from evolution._src.suite.baselines.practice import (
    POPULATION,
    SIGMA,
    Practice,
    draw_body,
    draw_genotypes,
    find_law,
)
from symbrion_gym._src.robot.organism import Organism

BODIES_DRAWN = 4
"""Random bodies that CMA-ES shares its budget between, where the body is free."""
TOURNAMENT = 3
"""Genotypes of which the fittest becomes a parent."""
MUTATED_SHARE = 0.3
"""Share of the genes of a child that change, by a normal deviation of `SIGMA`."""


def run_cmaes(practice: Practice, rng: np.random.Generator) -> None:
    """Let CMA-ES learn, of several random bodies one after the other where the body is free."""
    count = BODIES_DRAWN if practice.task.body is None else 1
    for number in range(count):
        body = draw_body(practice.task, rng)
        law = find_law(practice.task, body)
        strategy = _make_strategy(law, int(rng.integers(2**31)))
        try_zero(practice, body, law)
        while practice.has_time((number + 1) / count):
            genotypes = strategy.ask()
            strategy.tell(genotypes, practice.try_all(body, genotypes))


def run_genetic(practice: Practice, rng: np.random.Generator) -> None:
    """Let a population of genotypes of a given body evolve: tournaments, uniform crossover, mutation of some genes.

    The fittest of parents and children survive; a survivor keeps the fitness of its only trial.
    """
    assert practice.task.body is not None
    body = read_organism(practice.task.body)
    law = find_law(practice.task, body)
    zero = try_zero(practice, body, law)
    genotypes, fitness = np.zeros((1, len(law.parameters))), zero
    children = draw_genotypes(rng, law, POPULATION - 1)
    while practice.has_time():
        genotypes = np.concatenate([genotypes, children])
        fitness = np.concatenate([fitness, practice.try_all(body, children)])
        fittest = np.argsort(-fitness, kind="stable")[:POPULATION]
        genotypes, fitness = genotypes[fittest], fitness[fittest]
        children = breed(genotypes, law, rng)


def breed(
    parents: Float[np.ndarray, "P G"], law: Controller, rng: np.random.Generator
) -> Float[np.ndarray, "P G"]:
    """Return as many children as there are parents.

    Args:
        parents: the fittest first.
        law: bounds of the genes.
        rng: drawn from.
    """
    winners = rng.integers(len(parents), size=(2, len(parents), TOURNAMENT)).min(axis=2)
    first, second = parents[winners]
    children = np.where(rng.random(first.shape) < 0.5, first, second)
    is_mutated = rng.random(children.shape) < MUTATED_SHARE
    children = children + is_mutated * rng.normal(0.0, SIGMA, children.shape)
    return np.clip(children, law.lower, law.upper)


def try_zero(practice: Practice, body: Organism, law: Controller) -> Float[np.ndarray, " 1"]:
    """Try the zero genotype, and return its fitness."""
    return practice.try_all(body, np.zeros((1, len(law.parameters))))


def _make_strategy(law: Controller, seed: int) -> Strategy:
    count = len(law.parameters)
    space = Space(law.parameters, law.lower, law.upper, (0.0,) * count, (1.0,) * count)
    return Strategy(space, SIGMA, POPULATION, seed)
