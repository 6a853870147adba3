"""Algorithms by their names."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from evolution._src.body_search.algorithms.algorithm import Algorithm
from evolution._src.body_search.algorithms.archives import ANNEALING_RATE, ArchiveSearch
from evolution._src.body_search.algorithms.freeze_thaw import FreezeThawSearch
from evolution._src.body_search.algorithms.genetic import GeneticSearch, HalvingSearch, NicheSearch
from evolution._src.body_search.algorithms.sampling import ExhaustiveSearch, RandomSearch
from evolution._src.body_search.algorithms.surrogate import SurrogateSearch
from evolution._src.body_search.config import BodiesConfig, BodyEvolutionConfig
from evolution._src.body_search.learning import LearningConfig

_MAKERS: dict[str, Callable[..., Algorithm]] = {
    "freeze_thaw": FreezeThawSearch,
    "niches": NicheSearch,
    "surrogate": SurrogateSearch,
    "halving": HalvingSearch,
    "genetic": GeneticSearch,
    "map_elites": ArchiveSearch,
    "cma_mae": partial(ArchiveSearch, annealing_rate=ANNEALING_RATE),
    "random": RandomSearch,
    "exhaustive": ExhaustiveSearch,
}


def make_algorithm(config: BodyEvolutionConfig) -> Algorithm:
    """Return the algorithm of a run, with a random generator of its own."""
    return make_searcher(config.bodies, config.learning, config.seed)


def make_searcher(bodies: BodiesConfig, learning: LearningConfig, seed: int) -> Algorithm:
    """Return an algorithm with a random generator of its own, for bodies that learn in whatever way.

    Args:
        bodies: which bodies are searched, and how.
        learning: the rungs, and whether what was learned is inherited.
        seed: seed of the generator.
    """
    rng = np.random.default_rng((seed, *bodies.algorithm.encode()))
    return _MAKERS[bodies.algorithm](bodies, learning, rng)
