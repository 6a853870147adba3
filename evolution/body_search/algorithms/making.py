"""Algorithms by their names."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from evolution.body_search.algorithms.algorithm import Algorithm
from evolution.body_search.algorithms.archives import ANNEALING_RATE, ArchiveSearch
from evolution.body_search.algorithms.genetic import GeneticSearch, HalvingSearch
from evolution.body_search.algorithms.sampling import ExhaustiveSearch, RandomSearch
from evolution.body_search.config import BodyEvolutionConfig

_MAKERS: dict[str, Callable[..., Algorithm]] = {
    "halving": HalvingSearch,
    "genetic": GeneticSearch,
    "map_elites": ArchiveSearch,
    "cma_mae": partial(ArchiveSearch, annealing_rate=ANNEALING_RATE),
    "random": RandomSearch,
    "exhaustive": ExhaustiveSearch,
}


def make_algorithm(config: BodyEvolutionConfig) -> Algorithm:
    """Return the algorithm of a run, with a random generator of its own."""
    rng = np.random.default_rng((config.seed, *config.bodies.algorithm.encode()))
    return _MAKERS[config.bodies.algorithm](config.bodies, config.learning, rng)
