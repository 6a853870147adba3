"""Freeze-thaw search: learning pauses after each rung, and a prediction says which body goes on or begins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from evolution._src.body_search.algorithms.algorithm import Breeder, sort_by_fitness
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil
from evolution._src.body_search.prediction import Prediction

CANDIDATES = 30
"""New bodies bred for each one that learns; the prediction chooses among them and those that are paused."""
OPTIMISM = 2.0
"""Standard deviations added to a prediction: what is unknown is tried."""

NICHE_SHARE = 0.33
"""Share of the trials of learning that bodies of niches have. More of it finds an optimum that is alone sooner, and one
among good relatives later."""


class FreezeThawSearch:
    """A search in which the most promising body learns its next rung, be it paused or new.

    A Gaussian process over shapes of bodies predicts what a body will know in the end. Two rules choose in turn, so
    that each spends its share of the trials (`NICHE_SHARE`): the highest upper confidence bound of all bodies; and the
    highest one in a niche, the number of modules of which the fewest bodies have learned to the end. The first rule
    finds an optimum whose relatives are good; the second one that is alone, as there are few small bodies. What was
    chosen counts as learned as predicted until it is known, so that the bodies of an iteration differ.

    References:
        Swersky, Snoek, Adams (2014), Freeze-thaw Bayesian optimization, arXiv 1406.3896. Differs: learning pauses at
            rungs, and the bound is that of what is known in the end.
        Srinivas, Krause, Kakade, Seeger (2010), Gaussian process optimization in the bandit setting, ICML.
        Desautels, Krause, Burdick (2014), Parallelizing exploration-exploitation tradeoffs in Gaussian process bandit
            optimization, Journal of Machine Learning Research 15, section 4: bounds within a batch.
        Stanley, Miikkulainen (2002), Evolving neural networks through augmenting topologies, Evolutionary Computation
            10, section 3.3: niches.
    """

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.rungs) - 1
        self._breeder = Breeder(config, learning, rng)
        self._costs = [learning.count_trials(rung) for rung in range(len(learning.rungs))]
        self._trials, self._niche_trials = 0, 0
        self._latest: dict[str, Lesson] = {}
        self._lessons: list[Lesson] = []

    def ask(self) -> list[Assignment]:
        """Return the next rungs of the most promising bodies, the highest first; random bodies at first."""
        if not self._lessons:
            return [Assignment(each, 0) for each in self._breed_new(self._config.population_size)]
        paused = [
            Assignment(each.pupil, each.rung + 1) for each in self._latest.values() if each.rung < self._last
        ]
        new = [Assignment(each, 0) for each in self._breed_new(CANDIDATES * self._config.children)]
        chosen = self._choose([*paused, *new])
        chosen.sort(key=lambda each: -each.rung)
        return chosen or [Assignment(self._breeder.make_random(), 0)]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Keep the lessons, and the latest of each body."""
        for lesson in lessons:
            known = self._latest.get(lesson.pupil.key)
            if known is None or known.rung < lesson.rung:
                self._lessons.append(lesson)
                self._latest[lesson.pupil.key] = lesson

    def _breed_new(self, count: int) -> list[Pupil]:
        """Return children of the fittest that have not learned yet, each once."""
        parents = sort_by_fitness(self._lessons)[: self._config.population_size]
        bred = [self._breeder.breed(parents) for _ in range(count)]
        return list({each.key: each for each in bred if each.key not in self._latest}.values())

    def _choose(self, waiting: list[Assignment]) -> list[Assignment]:
        """Return as many assignments as an iteration has, by both rules in turn."""
        prediction = Prediction(self._lessons, self._last)
        learned = Counter(
            each.pupil.body.num_modules for each in self._latest.values() if each.rung == self._last
        )
        chosen: list[Assignment] = []
        while waiting and len(chosen) < self._config.children:
            mean, spread = prediction.predict([each.pupil.body for each in waiting])
            bounds = mean + OPTIMISM * spread
            counts = np.array([learned[each.pupil.body.num_modules] for each in waiting])
            is_turn_of_niches = self._niche_trials < NICHE_SHARE * self._trials
            order = np.lexsort((-bounds, counts)) if is_turn_of_niches else np.argsort(-bounds, kind="stable")
            chosen.append(waiting.pop(int(order[0])))
            body, rung = chosen[-1].pupil.body, chosen[-1].rung
            self._trials += self._costs[rung]
            self._niche_trials += is_turn_of_niches * self._costs[rung]
            prediction.expect(body, rung)
            learned[body.num_modules] += 1
        return chosen
