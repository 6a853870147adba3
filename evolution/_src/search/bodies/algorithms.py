"""Searches for bodies: led by a prediction, random, exhaustive. An algorithm asks for results and is told them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil
from typing import Protocol

import numpy as np

from evolution._src.backends.scoring import Scoring
from evolution._src.search.bodies.config import BodiesConfig, BodyEvolutionConfig
from evolution._src.search.bodies.genome import BodyGenome, enumerate_bodies
from evolution._src.search.bodies.learner import Assignment
from evolution._src.search.bodies.learning import LearningConfig, LevelResult
from evolution._src.search.bodies.prediction import Prediction
from evolution._src.search.bodies.run import BodyRun
from evolution._src.search.bodies.variation import cross_over, make_random_body, mutate

CANDIDATES = 30  # Children bred for each that learns, of which the prediction chooses
_CROSSOVER_SHARE = 0.25  # Share of children by crossover rather than mutation
_RANDOM_SHARE = 0.12  # Share of children that are new random bodies
_TOURNAMENT_SIZE = 3  # Bodies of which the fittest becomes a parent
OPTIMISM = 1.0  # Standard deviations added to a prediction: what is unknown is tried


class Algorithm(Protocol):
    """A search for bodies. It draws from a generator of its own, so that equal results give equal proposals."""

    def ask(self) -> list[Assignment]:
        """Return what shall be learned next; nothing where the search has come to its end."""
        ...

    def tell(self, results: Sequence[LevelResult]) -> None:
        """Take what was learned, in the order of the assignments."""
        ...


class Breeder:
    """Make children of parents, as the configuration says.

    Args:
        config: sizes of bodies.
        rng: drawn from.
    """

    def __init__(self, config: BodiesConfig, rng: np.random.Generator) -> None:
        self._config, self._rng = config, rng

    def make_random(self) -> BodyGenome:
        """Return a random body."""
        return make_random_body(self._rng, self._config.limits)

    def breed(self, parents: Sequence[LevelResult]) -> BodyGenome:
        """Return a child of one or two parents that win tournaments; random bodies where there is none."""
        if not parents or self._rng.random() < _RANDOM_SHARE:
            return self.make_random()
        first = self._select(parents)
        if self._rng.random() < _CROSSOVER_SHARE:
            second = self._select(parents)
            return cross_over(first.body, second.body, self._rng, self._config.limits)
        return mutate(first.body, self._rng, self._config.limits)

    def _select(self, parents: Sequence[LevelResult]) -> LevelResult:
        """Return the winner of a tournament: of those drawn, the first in the order of fitness."""
        return parents[int(self._rng.integers(len(parents), size=_TOURNAMENT_SIZE).min())]


class SurrogateSearch:
    """A genetic algorithm in levels in which a Gaussian process over shapes of bodies chooses.

    Many children are bred; those of the highest upper confidence bound learn the first level, and likewise those that
    learn on, so that a body is not judged by its first trials alone, and a young one has the credit of its relatives.

    References:
        Srinivas, Krause, Kakade, Seeger (2010), Gaussian process optimization in the bandit setting, ICML.
        Li and others (2020), A system for massively parallel hyperparameter tuning (ASHA), MLSys.
    """

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.levels) - 1
        self._breeder = Breeder(config, rng)
        self._layers: list[dict[str, LevelResult]] = [{} for _ in learning.levels]
        self._shares = [learning.compute_promoted_share(level) for level in range(self._last)]
        self._results: list[LevelResult] = []

    def ask(self) -> list[Assignment]:
        """Return promotions of each level, the highest first, then children; random bodies at first."""
        if not self._results:
            return [Assignment(each, 0) for each in self._breed_new([], self._config.population_size)]
        prediction = Prediction(self._results, self._last)
        fittest = sorted(
            self._results, key=lambda each: (-each.level, -each.fitness, each.body.canonical_text)
        )
        parents = fittest[: self._config.population_size]
        children = self._breed_new(parents, CANDIDATES * self._config.children)
        assignments = []
        for level in reversed(range(self._last)):
            layer, promoted = self._layers[level], self._layers[level + 1]
            count = ceil(self._shares[level] * len(layer)) - len(promoted)
            waiting = [result.body for key, result in layer.items() if key not in promoted]
            least = 0 if children else 1  # where no body is new, more learn on
            assignments += [
                Assignment(each, level + 1) for each in _choose(prediction, waiting, max(count, least))
            ]
        assignments += [Assignment(each, 0) for each in _choose(prediction, children, self._config.children)]
        return assignments or [Assignment(self._breeder.make_random(), 0)]

    def tell(self, results: Sequence[LevelResult]) -> None:
        """Put each result into the layer of its level."""
        for result in results:
            if result.body.canonical_text not in self._layers[result.level]:
                self._results.append(result)
            self._layers[result.level][result.body.canonical_text] = result

    def _breed_new(self, parents: Sequence[LevelResult], count: int) -> list[BodyGenome]:
        """Return children that have not learned yet, each once."""
        bred = [self._breeder.breed(parents) for _ in range(count)]
        return list(
            {
                each.canonical_text: each for each in bred if each.canonical_text not in self._layers[0]
            }.values()
        )


def _choose(prediction: Prediction, bodies: Sequence[BodyGenome], count: int) -> list[BodyGenome]:
    """Return the bodies of the highest upper confidence bounds."""
    if not bodies or not count:
        return []
    mean, spread = prediction.predict(bodies)
    order = np.argsort(-(mean + OPTIMISM * spread), kind="stable")
    return [bodies[index] for index in order[:count]]


class RandomSearch:
    """Random bodies, each of which learns to the last level."""

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.levels) - 1
        self._breeder = Breeder(config, rng)

    def ask(self) -> list[Assignment]:
        """Return the bodies of an iteration."""
        return [Assignment(self._breeder.make_random(), self._last) for _ in range(self._config.children)]

    def tell(self, results: Sequence[LevelResult]) -> None:
        """Nothing is learned from results."""


class ExhaustiveSearch:
    """All bodies, the small ones first, each of which learns to the last level."""

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last = config, len(learning.levels) - 1
        self._bodies = self._list()

    def ask(self) -> list[Assignment]:
        """Return the bodies of an iteration; nothing after the last."""
        bodies = (next(self._bodies, None) for _ in range(self._config.children))
        return [Assignment(body, self._last) for body in bodies if body is not None]

    def tell(self, results: Sequence[LevelResult]) -> None:
        """Nothing depends on results."""

    def _list(self) -> Iterator[BodyGenome]:
        for count in range(self._config.smallest, self._config.largest + 1):
            yield from enumerate_bodies(count)


_MAKERS: dict[str, Callable[..., Algorithm]] = {
    "surrogate": SurrogateSearch,
    "random": RandomSearch,
    "exhaustive": ExhaustiveSearch,
}


def make_algorithm(config: BodyEvolutionConfig) -> Algorithm:
    """Return the algorithm of a run, with a random generator of its own."""
    rng = np.random.default_rng((config.seed, *config.bodies.algorithm.encode()))
    return _MAKERS[config.bodies.algorithm](config.bodies, config.learning, rng)


def describe_success(run: BodyRun) -> str:
    """Return in words how often the champion of a run succeeded, in which trials, and its fitness."""
    champion = run.champion
    assert champion is not None
    rate, fitness = (
        f"{champion.successes} of {champion.trials}",
        f"{format_fitness(run, champion.fitness)} in its exam",
    )
    if run.confirmation is None:
        return f"succeeded in {rate} trials of its exam, not confirmed by fresh trials; {fitness}"
    if champion.successes:
        return f"succeeded in {rate} fresh trials; {fitness}"
    return f"no success: {rate} fresh trials, and no other candidate did better; {fitness}"


def format_fitness(run: BodyRun, fitness: float) -> str:
    """Return a fitness in words, in meters where the weights that ship make it of progress in meters."""
    unit = " m" if isinstance(run.config.scoring, Scoring) else ""
    return f"fitness {fitness:.2f}{unit}"


def compute_effort_weight(config: BodyEvolutionConfig) -> float:
    """Return the effort of a joule of work of the hinges."""
    from symbrion_gym._src.tasks.catalog import UsualTerms  # loads MuJoCo

    return float(dict(config.environment).get("effort_weight", UsualTerms.effort_weight)) or 1.0


def explain_fitness(run: BodyRun) -> str:
    """Return what a fitness means, in one sentence."""
    scoring = run.config.scoring
    if not isinstance(scoring, Scoring):
        return "Fitness is what the scoring of this run returns; higher is better."
    text = (
        "Fitness, in meters: how far the whole body came on its way, as a mean over trials, plus "
        f"{scoring.success:g} m times the share of trials that succeeded, less "
        f"{scoring.effort * compute_effort_weight(run.config):.2g} m for each joule of work of the hinges"
    )
    return (
        f"{text}{f' and {scoring.module:g} m for each module' if scoring.module else ''}. Higher is better."
    )
