"""Searches for bodies: led by a prediction, random, exhaustive. An algorithm asks for results and is told them.

The prediction is a Gaussian process over shapes, bodies and levels. The covariance of what body i knows at level r and
body j at level s, in units of the spreads of their levels:

    ((1 - b) exp(-|x_i - x_j|^2 / (2 l^2)) + b [i = j]) c^|r - s| + n [i = j and r = s]

with x the shape of a body, l how far shapes are alike, b what a body has of its own, c how much a level tells of the
next one, and n the noise of an exam. All four are those of a small grid under which the data are likeliest.

References:
    Rasmussen, Williams (2006), Gaussian Processes for Machine Learning, algorithm 2.1 and equation 5.8.
    Swersky, Snoek, Adams (2013), Multi-task Bayesian optimization, NeurIPS: products of a kernel over inputs and one
    over tasks, which are the levels here.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import chain, islice, pairwise, product, repeat
from math import ceil
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from evolution._src.search.bodies.config import BodiesConfig, BodyEvolutionConfig, LearningConfig
from evolution._src.search.bodies.genome import (
    BodyGenome,
    cross_over,
    enumerate_bodies,
    make_random_body,
    mutate,
)

CANDIDATES = 30  # Children bred for each that learns, of which the prediction chooses
_CROSSOVER_SHARE = 0.25  # Share of children by crossover rather than mutation
_RANDOM_SHARE = 0.12  # Share of children that are new random bodies
_TOURNAMENT_SIZE = 3  # Bodies of which the fittest becomes a parent
OPTIMISM = 1.0  # Standard deviations added to a prediction: what is unknown is tried
MAX_RESULTS = 250  # Results that a prediction rests on, the last ones: its time grows with their third power
_REACHES, _OWN, _BETWEEN, _NOISES = (0.7, 1.5, 3.0), (0.1, 0.4, 0.8), (0.95, 0.7, 0.3), (0.01, 0.1, 0.4)
"""Values of l [modules], b, c and n."""
_ALONG = 0.7  # A module looks along the body where the cosine of its heading is beyond this
_SMALLEST_SPREAD = 1e-9


class Assignment(NamedTuple):
    """A body, and the level to which it shall learn."""

    body: BodyGenome  # the body and where it begins
    level: int  # index of the level


class LevelResult(NamedTuple):
    """What a body has learned at the end of a level."""

    body: BodyGenome  # its genome
    level: int  # index of the level
    # fitness of the best genotype in the trials of the exam; without an exam, that of learning
    fitness: float
    successes: int  # its successful trials there
    trials: int  # number of these; 0 without an exam
    effort: float  # mean effort there
    genotype: tuple[float, ...]  # the best genotype of learning
    names: tuple[str, ...]  # names of its genes
    curve: tuple[float, ...]  # best fitness of each generation of learning
    seconds: float  # simulated in this level [s]


def make_algorithm(config: BodyEvolutionConfig) -> "SurrogateSearch | ListSearch":
    """Return the algorithm of a run, with a random generator of its own."""
    rng = np.random.default_rng((config.seed, *config.bodies.algorithm.encode()))
    if config.bodies.algorithm == "surrogate":
        return SurrogateSearch(config.bodies, config.learning, rng)
    if config.bodies.algorithm == "random":
        bodies = (make_random_body(rng, limits) for limits in repeat(config.bodies.limits))
    else:  # all, the small ones first
        sizes = range(config.bodies.smallest, config.bodies.largest + 1)
        bodies = chain.from_iterable(map(enumerate_bodies, sizes))
    return ListSearch(bodies, config.bodies.children, config.learning.last)


class ListSearch:
    """Bodies one after the other, random ones or all, each of which learns to the last level."""

    def __init__(self, bodies: Iterator[BodyGenome], count: int, level: int) -> None:
        self._bodies, self._count, self._level = bodies, count, level

    def ask(self) -> list[Assignment]:
        """Return the bodies of an iteration; nothing after the last."""
        return [Assignment(body, self._level) for body in islice(self._bodies, self._count)]

    def tell(self, results: Sequence[LevelResult]) -> None:
        """Nothing depends on results."""


class SurrogateSearch:
    """A genetic algorithm in levels in which a Gaussian process over shapes of bodies chooses.

    Many children are bred; those of the highest upper confidence bound learn the first level, and likewise those that
    learn on, so that a body is not judged by its first trials alone, and a young one has the credit of its relatives.

    References:
        Srinivas, Krause, Kakade, Seeger (2010), Gaussian process optimization in the bandit setting, ICML.
        Li and others (2020), A system for massively parallel hyperparameter tuning (ASHA), MLSys.
    """

    def __init__(self, config: BodiesConfig, learning: LearningConfig, rng: np.random.Generator) -> None:
        self._config, self._last, self._rng = config, learning.last, rng
        self._layers: list[dict[str, LevelResult]] = [{} for _ in learning.levels]
        costs = [learning.count_trials(level) for level in range(len(learning.levels))]
        # which share of the bodies of a level may learn on, so that the next level costs as much in all
        self._shares = [min(this / following, 1.0) for this, following in pairwise(costs)]
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
            chosen = _choose(prediction, waiting, max(count, least))
            assignments += [Assignment(each, level + 1) for each in chosen]
        assignments += [Assignment(each, 0) for each in _choose(prediction, children, self._config.children)]
        return assignments or [Assignment(make_random_body(self._rng, self._config.limits), 0)]

    def tell(self, results: Sequence[LevelResult]) -> None:
        """Put each result into the layer of its level."""
        for result in results:
            if result.body.canonical_text not in self._layers[result.level]:
                self._results.append(result)
            self._layers[result.level][result.body.canonical_text] = result

    def _breed_new(self, parents: Sequence[LevelResult], count: int) -> list[BodyGenome]:
        """Return children that have not learned yet, each once."""
        bred = {each.canonical_text: each for each in [self._breed(parents) for _ in range(count)]}
        return [each for key, each in bred.items() if key not in self._layers[0]]

    def _breed(self, parents: Sequence[LevelResult]) -> BodyGenome:
        """Return a child of one or two parents that win tournaments; random bodies where there is none."""
        rng, limits = self._rng, self._config.limits
        if not parents or rng.random() < _RANDOM_SHARE:
            return make_random_body(rng, limits)
        first = self._select(parents)
        if rng.random() < _CROSSOVER_SHARE:
            return cross_over(first, self._select(parents), rng, limits)
        return mutate(first, rng, limits)

    def _select(self, parents: Sequence[LevelResult]) -> BodyGenome:
        """Return the winner of a tournament: of those drawn, the first in the order of fitness."""
        return parents[int(self._rng.integers(len(parents), size=_TOURNAMENT_SIZE).min())].body


def _choose(prediction: "Prediction", bodies: Sequence[BodyGenome], count: int) -> list[BodyGenome]:
    """Return the bodies of the highest upper confidence bounds."""
    if not bodies or not count:
        return []
    mean, spread = prediction.predict(bodies)
    order = np.argsort(-(mean + OPTIMISM * spread), kind="stable")
    return [bodies[index] for index in order[:count]]


class _Results(NamedTuple):
    """Results as numbers."""

    shapes: Float[np.ndarray, "N 7"]  # of the bodies, see `describe_shape`
    bodies: Int[np.ndarray, " N"]  # number of each body; equal for equal bodies
    levels: Int[np.ndarray, " N"]  # index of the level


@lru_cache(maxsize=20_000)
def describe_shape(text: str) -> Float[np.ndarray, " 7"]:
    """Return the shape of a body by its canonical text, everything in numbers or lengths of modules."""
    body = BodyGenome.parse(text)
    poses = body.to_organism().compute_poses()
    places = np.array([(pose.x, pose.y) for pose in poses]) / body.to_organism().scout.size[0]
    along = sum(abs(np.cos(pose.heading)) > _ALONG for pose in poses)
    row, limb = 1, body
    while limb.back is not None:
        row, limb = row + 1, limb.back
    depth = 1 + max(len(path) for path in body.find_paths())
    length, width = np.ptp(places, axis=0)
    return np.array([len(poses), length, width, along, row, depth, abs(places[:, 1].mean())], dtype=float)


class Prediction:
    """What bodies will know at the end of the last level, from what is known, one result at least."""

    def __init__(self, results: Sequence[LevelResult], last: int) -> None:
        results = list(results)[-MAX_RESULTS:]
        self._last, self._numbers = last, {}
        self._known = self._to_numbers([each.body for each in results], [each.level for each in results])
        fitness = np.array([each.fitness for each in results])
        self._centers, self._spreads = _find_scales(fitness, self._known, last)
        values = (fitness - self._centers[self._known.levels]) / self._spreads[self._known.levels]
        compared = _compare(self._known, self._known)
        self._parameters, noise = _find_likeliest(compared, values)
        covariance = _compute_covariance(compared, self._parameters)
        self._root = np.linalg.cholesky(covariance + (noise + _SMALLEST_SPREAD) * np.eye(len(covariance)))
        self._weights = np.linalg.solve(self._root.T, np.linalg.solve(self._root, values))

    def predict(
        self, bodies: Sequence[BodyGenome]
    ) -> tuple[Float[np.ndarray, " B"], Float[np.ndarray, " B"]]:
        """Return mean and standard deviation of what bodies will know at the end of the last level."""
        asked = self._to_numbers(bodies, [self._last] * len(bodies))
        shared = _compute_covariance(_compare(asked, self._known), self._parameters)
        explained = np.linalg.solve(self._root, shared.T)
        variance = np.maximum(1.0 - np.sum(explained**2, axis=0), 0.0)
        center, spread = self._centers[self._last], self._spreads[self._last]
        return center + spread * (shared @ self._weights), spread * np.sqrt(variance)

    def _to_numbers(self, bodies: Sequence[BodyGenome], levels: Sequence[int]) -> _Results:
        texts = [body.canonical_text for body in bodies]
        numbers = [self._numbers.setdefault(text, len(self._numbers)) for text in texts]
        return _Results(
            np.array([describe_shape(text) for text in texts]), np.array(numbers), np.array(levels)
        )


def _find_likeliest(
    compared: tuple[np.ndarray, np.ndarray, np.ndarray], values: Float[np.ndarray, " N"]
) -> tuple[tuple[float, float, float], float]:
    """Return l, b and c, and n, of the grid under which the values are likeliest, of equals the first."""
    from scipy.linalg import cho_solve, cholesky

    best, likeliest = -np.inf, ((_REACHES[0], _OWN[0], _BETWEEN[0]), _NOISES[0])
    for parameters in product(_REACHES, _OWN, _BETWEEN):
        shared = _compute_covariance(compared, parameters)
        for noise in _NOISES:
            covariance = shared + (noise + _SMALLEST_SPREAD) * np.eye(len(shared))
            root = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
            weights = cho_solve((root, True), values, check_finite=False)
            likelihood = -0.5 * float(values @ weights) - float(np.log(np.diag(root)).sum())
            if likelihood > best:
                best, likeliest = likelihood, (parameters, noise)
    return likeliest


def _compare(first: _Results, second: _Results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return squared distances of shapes, whether bodies are the same, and levels between them, each `[N, M]`."""
    squares = np.sum((first.shapes[:, None] - second.shapes[None]) ** 2, axis=-1)
    is_same = first.bodies[:, None] == second.bodies[None]
    return squares, is_same, np.abs(first.levels[:, None] - second.levels[None])


def _compute_covariance(
    compared: tuple[np.ndarray, np.ndarray, np.ndarray], parameters: tuple[float, float, float]
) -> Float[np.ndarray, "N M"]:
    """Return the covariance of what is known without noise, at l, b and c."""
    (squares, is_same, levels), (reach, own, between) = compared, parameters
    return ((1.0 - own) * np.exp(-0.5 * squares / reach**2) + own * is_same) * between**levels


def _find_scales(
    fitness: Float[np.ndarray, " N"], results: _Results, last: int
) -> tuple[Float[np.ndarray, " R"], Float[np.ndarray, " R"]]:
    """Return the center of each level, and the spread around it.

    Those that learn on are the better ones, and alike, so that their mean and spread are not those of their level: a
    center is that of the level before and what its bodies have gained since, a spread at least as large.
    """
    centers, spreads = np.zeros(last + 1), np.full(last + 1, _SMALLEST_SPREAD)
    for level in range(last + 1):
        here = np.flatnonzero(results.levels == level)
        before = {results.bodies[i]: fitness[i] for i in np.flatnonzero(results.levels == level - 1)}
        gains = [fitness[i] - before[results.bodies[i]] for i in here if results.bodies[i] in before]
        if gains:
            centers[level] = centers[level - 1] + np.mean(gains)
        elif level or len(here):
            centers[level] = fitness[here].mean() if len(here) else centers[level - 1]
        own = fitness[here].std() if len(here) else 0.0
        spreads[level] = max(own, spreads[max(level - 1, 0)])
    return centers, spreads
