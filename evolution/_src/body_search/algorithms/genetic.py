"""Genetic algorithms over bodies: with learning in rungs (successive halving), with niches in these, and without."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import ceil

import numpy as np

from evolution._src.body_search.algorithms.algorithm import Breeder, find_shares, sort_by_fitness
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil


class GeneticSearch:
    """A population of the fittest bodies; every child learns to the last rung."""

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.rungs) - 1
        self._breeder = Breeder(config, learning, rng)
        self._population: list[Lesson] = []

    def ask(self) -> list[Assignment]:
        """Return children; random bodies at first."""
        count = self._config.children if self._population else self._config.population_size
        return [Assignment(self._breeder.breed(self._population), self._last) for _ in range(count)]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Keep the fittest of parents and children, each body once."""
        known: dict[str, Lesson] = {}
        for lesson in sort_by_fitness([*self._population, *lessons]):
            known.setdefault(lesson.pupil.body.canonical_text, lesson)
        self._population = list(known.values())[: self._config.population_size]


class HalvingSearch:
    """A genetic algorithm in which a body competes with those that have learned as much as it has.

    Children learn the first rung. In each iteration the fittest of every rung that have not learned on do so, as many
    as make all rungs cost the same, so that hopeless bodies cost little and young ones are never compared with
    bodies that have learned longer. Parents win tournaments among the fittest of a random rung.

    References:
        Li, Jamieson, Rostamizadeh, Gonina, Hardt, Recht, Talwalkar (2020), A system for massively parallel
        hyperparameter tuning (ASHA), MLSys. Hornby (2006), ALPS: the age-layered population structure, GECCO: layers
        by age that protect the young. Differs: the layers are the rungs of learning.
    """

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._rng = config, rng
        self._breeder = Breeder(config, learning, rng)
        self._layers: list[dict[str, Lesson]] = [{} for _ in learning.rungs]
        self._shares = find_shares(config, learning)

    def ask(self) -> list[Assignment]:
        """Return promotions of each rung, the highest first, then children."""
        children = self._breed_new()
        least = 0 if children else 1  # where no body is new, more learn on
        assignments = []
        for rung in reversed(range(len(self._layers) - 1)):
            layer, promoted = self._layers[rung], self._layers[rung + 1]
            count = ceil(self._shares[rung] * len(layer)) - len(promoted)
            waiting = sort_by_fitness([lesson for key, lesson in layer.items() if key not in promoted])
            for lesson in self._rank(waiting, list(promoted.values()))[: max(count, least)]:
                assignments.append(Assignment(lesson.pupil, rung + 1))
        assignments += [Assignment(child, 0) for child in children]
        return assignments or [Assignment(self._breeder.make_random(), 0)]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Put each lesson into the layer of its rung."""
        for lesson in lessons:
            self._layers[lesson.rung][lesson.pupil.key] = lesson

    def _rank(self, waiting: list[Lesson], promoted: Sequence[Lesson]) -> list[Lesson]:
        """Return the lessons of a rung, the fittest first, in the order in which their bodies learn on."""
        return waiting

    def _breed_new(self) -> list[Pupil]:
        """Return children that have not learned yet, each once."""
        bred = [self._breeder.breed(self._choose_parents()) for _ in range(self._config.children)]
        return list({each.key: each for each in bred if each.key not in self._layers[0]}.values())

    def _choose_parents(self) -> list[Lesson]:
        """Return the fittest of a random layer; none at first."""
        layers = [layer for layer in self._layers if layer]
        if not layers:
            return []
        layer = layers[int(self._rng.integers(len(layers)))]
        return sort_by_fitness(list(layer.values()))[: self._config.population_size]


class NicheSearch(HalvingSearch):
    """Successive halving in which a body competes with those of its size, too.

    Larger bodies have more tracks and more genes, so that what they know after a few trials says little about smaller
    ones, and the other way round. So the bodies of a rung that learn on come from all numbers of modules in turn: the
    fittest of the number of which the fewest have learned on goes first, of equals the fittest.

    References:
        Stanley, Miikkulainen (2002), Evolving neural networks through augmenting topologies, Evolutionary Computation
        10, section 3.3: individuals compete within their niche. Differs: the niches are the numbers of modules.
    """

    def _rank(self, waiting: list[Lesson], promoted: Sequence[Lesson]) -> list[Lesson]:
        """Return the lessons of a rung, the niches in turn."""
        taken = Counter(lesson.pupil.body.num_modules for lesson in promoted)
        turns = []
        for order, lesson in enumerate(waiting):
            size = lesson.pupil.body.num_modules
            turns.append((taken[size], order))
            taken[size] += 1
        return [waiting[order] for _, order in sorted(turns)]
