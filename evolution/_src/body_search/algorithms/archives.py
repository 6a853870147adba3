"""MAP-Elites and CMA-MAE over bodies: an archive of pyribs with a cell for each kind of body.

References:
    Mouret, Clune (2015), Illuminating search spaces by mapping elites, arXiv 1504.04909.
    Fontaine, Nikolaidis (2023), Covariance matrix adaptation MAP-annealing, GECCO: thresholds that rise by a learning
    rate. Differs: the genomes are trees, so that children come from mutations; CMA-ES is what each body learns with.
    Nordmoen, Veenstra, Ellefsen, Glette (2021), MAP-Elites enables powerful stepping stones and diversity for modular
    robotics, Frontiers in Robotics and AI 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evolution._src.body_search.algorithms.algorithm import Breeder, sort_by_fitness
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.descriptors import DESCRIPTORS
from evolution._src.body_search.learner import Assignment
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil
from reconstruction._src.base.extras import require_extras

ANNEALING_RATE = 0.1
"""Share by which the threshold of a cell rises towards a new elite, in CMA-MAE."""


class ArchiveSearch:
    """Elites of each cell are the parents of new bodies, all equally often."""

    def __init__(
        self,
        config: BodiesConfig,
        learning: LearningConfig,
        rng: np.random.Generator,
        annealing_rate: float | None = None,
    ) -> None:
        self._config, self._last, self._rng = config, len(learning.rungs) - 1, rng
        self._breeder = Breeder(config, learning, rng)
        self._archive = _make_archive(config, annealing_rate)
        self._lessons: list[Lesson] = []

    @property
    def elites(self) -> list[Lesson]:
        """The elite of each cell that has one, the fittest first."""
        indices = self._archive.data("solution")[:, 0].astype(int)
        return sort_by_fitness([self._lessons[index] for index in indices])

    def ask(self) -> list[Assignment]:
        """Return children of random elites; random bodies at first."""
        elites = self.elites if self._lessons else []
        count = self._config.children if elites else self._config.population_size
        return [Assignment(self._breed(elites), self._last) for _ in range(count)]

    def tell(self, lessons: Sequence[Lesson]) -> None:
        """Offer each lesson to the archive, which keeps its index."""
        for lesson in lessons:
            self._lessons.append(lesson)
            index = np.array([len(self._lessons) - 1.0])
            measures = [DESCRIPTORS[name].measure(lesson) for name in self._config.axes]
            self._archive.add_single(index, lesson.fitness, np.array(measures))

    def _breed(self, elites: list[Lesson]) -> Pupil:
        chosen = [elites[int(self._rng.integers(len(elites)))] for _ in range(2)] if elites else []
        return self._breeder.breed(chosen)


def _make_archive(config: BodiesConfig, annealing_rate: float | None) -> Any:
    """Return an empty archive of indices of lessons."""
    require_extras("MAP-Elites over bodies", "ribs")
    from ribs.archives import GridArchive

    axes = [DESCRIPTORS[name].limits(config.smallest, config.largest) for name in config.axes]
    annealing = {} if annealing_rate is None else {"learning_rate": annealing_rate, "threshold_min": -1.0}
    return GridArchive(
        solution_dim=1,
        dims=[count for count, _, _ in axes],
        ranges=[(low, high) for _, low, high in axes],
        **annealing,
    )
