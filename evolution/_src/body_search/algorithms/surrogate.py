"""Successive halving led by a prediction: it says which children are worth a first rung, and which bodies learn on."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from evolution._src.body_search.algorithms.algorithm import Breeder, find_shares, sort_by_fitness
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil
from evolution._src.body_search.prediction import Prediction

CANDIDATES = 30
"""Children bred for each that learns, of which the prediction chooses."""
OPTIMISM = 1.0
"""Standard deviations added to a prediction: what is unknown is tried."""


class SurrogateSearch:
    """A genetic algorithm in rungs in which a Gaussian process over shapes of bodies chooses.

    Many children are bred; those of the highest upper confidence bound learn the first rung, and likewise those that
    learn on, so that a body is not judged by its first trials alone, and a young one has the credit of its relatives.

    References:
        Srinivas, Krause, Kakade, Seeger (2010), Gaussian process optimization in the bandit setting, ICML.
        Li and others (2020), A system for massively parallel hyperparameter tuning (ASHA), MLSys.
    """

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.rungs) - 1
        self._breeder = Breeder(config, learning, rng)
        self._layers: list[dict[str, Lesson]] = [{} for _ in learning.rungs]
        self._shares = find_shares(config, learning)
        self._lessons: list[Lesson] = []

    def ask(self) -> list[Assignment]:
        """Return promotions of each rung, the highest first, then children; random bodies at first."""
        if not self._lessons:
            return [Assignment(each, 0) for each in self._breed_new([], self._config.population_size)]
        prediction = Prediction(self._lessons, self._last)
        parents = sort_by_fitness(self._lessons)[: self._config.population_size]
        children = self._breed_new(parents, CANDIDATES * self._config.children)
        assignments = []
        for rung in reversed(range(self._last)):
            layer, promoted = self._layers[rung], self._layers[rung + 1]
            count = ceil(self._shares[rung] * len(layer)) - len(promoted)
            waiting = [lesson.pupil for key, lesson in layer.items() if key not in promoted]
            least = 0 if children else 1  # where no body is new, more learn on
            assignments += [
                Assignment(each, rung + 1) for each in _choose(prediction, waiting, max(count, least))
            ]
        assignments += [Assignment(each, 0) for each in _choose(prediction, children, self._config.children)]
        return assignments or [Assignment(self._breeder.make_random(), 0)]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Put each lesson into the layer of its rung."""
        for lesson in lessons:
            if lesson.pupil.key not in self._layers[lesson.rung]:
                self._lessons.append(lesson)
            self._layers[lesson.rung][lesson.pupil.key] = lesson

    def _breed_new(self, parents: Sequence[Lesson], count: int) -> list[Pupil]:
        """Return children that have not learned yet, each once."""
        bred = [self._breeder.breed(parents) for _ in range(count)]
        return list({each.key: each for each in bred if each.key not in self._layers[0]}.values())


def _choose(prediction: Prediction, pupils: Sequence[Pupil], count: int) -> list[Pupil]:
    """Return the pupils of the highest upper confidence bounds."""
    if not pupils or not count:
        return []
    mean, spread = prediction.predict([each.body for each in pupils])
    order = np.argsort(-(mean + OPTIMISM * spread), kind="stable")
    return [pupils[index] for index in order[:count]]
