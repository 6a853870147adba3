"""What an algorithm is: it asks for lessons, and is told what was learned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from evolution._src.bodies.genome import BodyGenome, parse_genome
from evolution._src.bodies.variation import cross_over, make_random_body, mutate
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil, inherit


class Algorithm(Protocol):
    """A search for bodies. It draws from a generator of its own, so that equal lessons give equal proposals."""

    def ask(self) -> list[Assignment]:
        """Return what shall be learned next; nothing where the search has come to its end."""
        ...

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Take what was learned, in the order of the assignments."""
        ...


class Breeder:
    """Make children of parents, as the configuration says.

    Args:
        config: shares of crossover and random bodies, mutations, sizes.
        learning: whether what was learned is inherited.
        rng: drawn from.
    """

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._learning, self._rng = config, learning, rng
        self._founders = [parse_genome(text) for text in reversed(config.founders)]

    def make_random(self) -> Pupil:
        """Return a random body."""
        return Pupil(make_random_body(self._rng, self._config.limits))

    def breed(self, parents: Sequence[Lesson]) -> Pupil:
        """Return a child of one or two parents that win tournaments; founders and random bodies where there is none.

        Args:
            parents: those that may take part, the fittest first.
        """
        if self._founders:
            return Pupil(self._founders.pop(), self._config.founder_genes)
        if not parents or self._rng.random() < self._config.random_share:
            return self.make_random()
        first = self._select(parents)
        if self._rng.random() < self._config.crossover_share:
            child = self._cross(first.pupil.body, self._select(parents).pupil.body)
        else:
            child = mutate(first.pupil.body, self._rng, self._config.limits, self._config.operators)
        return Pupil(child, inherit(first) if self._learning.is_inherited else ())

    def _select(self, parents: Sequence[Lesson]) -> Lesson:
        """Return the winner of a tournament: of those drawn, the first in the order of fitness."""
        return parents[int(self._rng.integers(len(parents), size=self._config.tournament_size).min())]

    def _cross(self, first: BodyGenome, second: BodyGenome) -> BodyGenome:
        return cross_over(first, second, self._rng, self._config.limits)


def find_shares(config: BodiesConfig, learning: LearningConfig) -> list[float]:
    """Return which share of the bodies of each rung but the last learn on."""
    rungs = range(len(learning.rungs) - 1)
    if config.promoted_share is None:
        return [learning.find_promoted_share(rung) for rung in rungs]
    return [config.promoted_share for _ in rungs]


def sort_by_fitness(lessons: Sequence[Lesson]) -> list[Lesson]:
    """Return lessons, those of later rungs first and the fittest of a rung first; equals by their bodies."""
    return sorted(lessons, key=lambda each: (-each.rung, -each.fitness, each.pupil.key))
