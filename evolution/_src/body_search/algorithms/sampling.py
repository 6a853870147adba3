"""Searches without selection: random bodies, and all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from evolution._src.bodies.enumeration import enumerate_bodies
from evolution._src.body_search.algorithms.algorithm import Breeder
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil


class RandomSearch:
    """Random bodies, each of which learns to the last rung."""

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.rungs) - 1
        self._breeder = Breeder(config, learning, rng)

    def ask(self) -> list[Assignment]:
        """Return the bodies of an iteration."""
        return [Assignment(self._breeder.make_random(), self._last) for _ in range(self._config.children)]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Nothing is learned from lessons."""


class ExhaustiveSearch:
    """All bodies, the small ones first, each of which learns to the last rung."""

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.rungs) - 1
        self._bodies = self._list()

    def ask(self) -> list[Assignment]:
        """Return the bodies of an iteration; nothing after the last."""
        bodies = (next(self._bodies, None) for _ in range(self._config.children))
        return [Assignment(pupil, self._last) for pupil in bodies if pupil is not None]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Nothing depends on lessons."""

    def _list(self) -> Iterator[Pupil]:
        for count in range(self._config.smallest, self._config.largest + 1):
            yield from (Pupil(body) for body in enumerate_bodies(count))
