"""Baselines that learn nothing: doing nothing, and drawing at random."""

from __future__ import annotations

import numpy as np

from evolution._src.backends.parts import read_organism
from evolution._src.suite.baselines.practice import Practice, draw_body, draw_genotypes, find_law

RESTING_BODY = 3
"""Modules in a row, where the body is free and nothing is searched."""


def do_nothing(practice: Practice, rng: np.random.Generator) -> None:
    """Offer the zero genotype, untried: tracks full speed ahead, hinges straight."""
    task = practice.task
    body = read_organism(RESTING_BODY if task.body is None else task.body)
    genotype = np.zeros((1, len(find_law(task, body).parameters)))
    practice.offer(body, genotype, np.zeros(1))


def draw(practice: Practice, rng: np.random.Generator) -> None:
    """Draw genotypes around zero, and a body with each generation where it is free."""
    while practice.has_time():
        body = draw_body(practice.task, rng)
        practice.try_all(body, draw_genotypes(rng, find_law(practice.task, body)))
