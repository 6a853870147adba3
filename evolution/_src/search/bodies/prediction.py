"""Predict what a body will have learned from what others have: a Gaussian process over shapes, bodies and levels.

The covariance of what body i knows at level r and body j at level s, in units of the spreads of their levels:

    ((1 - b) exp(-|x_i - x_j|^2 / (2 l^2)) + b [i = j]) c^|r - s| + n [i = j and r = s]

with x the shape of a body, l how far shapes are alike, b what a body has of its own, c how much a level tells of the
next one, and n the noise of an exam. All four are those of a small grid under which the data are likeliest.

References:
    Rasmussen, Williams (2006), Gaussian Processes for Machine Learning, algorithm 2.1 and equation 5.8.
    Swersky, Snoek, Adams (2013), Multi-task Bayesian optimization, NeurIPS: products of a kernel over inputs and one
    over tasks, which are the levels here.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.search.bodies.genome import BodyGenome, parse_genome
from evolution._src.search.bodies.learning import LevelResult

MAX_LESSONS = 250  # Results that a prediction rests on, the last ones: its time grows with their third power
_REACHES, _OWN, _BETWEEN, _NOISES = (0.7, 1.5, 3.0), (0.1, 0.4, 0.8), (0.95, 0.7, 0.3), (0.01, 0.1, 0.4)
"""Values of l [modules], b, c and n."""
_ALONG = 0.7  # A module looks along the body where the cosine of its heading is beyond this
_SMALLEST_SPREAD = 1e-9


class _Levels(NamedTuple):
    """Results as numbers."""

    shapes: Float[np.ndarray, "N 7"]  # of the bodies, see `describe_shape`
    bodies: Int[np.ndarray, " N"]  # number of each body; equal for equal bodies
    levels: Int[np.ndarray, " N"]  # index of the level


class _Likeness(NamedTuple):
    """How results differ from others."""

    squares: Float[np.ndarray, "N M"]  # squared distances of the shapes
    is_same: Bool[np.ndarray, "N M"]  # whether the body is the same one
    levels: Int[np.ndarray, "N M"]  # levels between them


def describe_shape(body: BodyGenome) -> Float[np.ndarray, " 7"]:
    """Return the shape of a body, everything in numbers or lengths of modules; equal for mirror images."""
    return _describe(body.canonical_text)


@lru_cache(maxsize=20_000)
def _describe(text: str) -> Float[np.ndarray, " 7"]:
    body = parse_genome(text)
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
    """What bodies will know at the end of the last level.

    Args:
        results: what is known; one at least.
        last: index of the last level.
    """

    def __init__(self, results: Sequence[LevelResult], last: int) -> None:
        results = list(results)[-MAX_LESSONS:]
        self._last, self._numbers = last, {}
        self._known = self._to_numbers([each.body for each in results], [each.level for each in results])
        fitness = np.array([each.fitness for each in results])
        self._centers, self._spreads = _find_scales(fitness, self._known, last)
        self._values = (fitness - self._centers[self._known.levels]) / self._spreads[self._known.levels]
        likeness = _compare(self._known, self._known)
        self._parameters = _find_likeliest(likeness, self._values)
        self._root, self._weights = self._solve(likeness)

    def predict(
        self, bodies: Sequence[BodyGenome]
    ) -> tuple[Float[np.ndarray, " B"], Float[np.ndarray, " B"]]:
        """Return mean and standard deviation of what bodies will know at the end of the last level."""
        shared, explained = self._relate(self._to_numbers(bodies, [self._last] * len(bodies)))
        variance = np.maximum(1.0 - np.sum(explained**2, axis=0), 0.0)
        center, spread = self._centers[self._last], self._spreads[self._last]
        return center + spread * (shared @ self._weights), spread * np.sqrt(variance)

    def expect(self, body: BodyGenome, level: int) -> None:
        """Take a body as if it had learned a level as predicted: means stay, and deviations of its kin shrink.

        References:
            Desautels, Krause, Burdick (2014), Parallelizing exploration-exploitation tradeoffs in Gaussian process
            bandit optimization, Journal of Machine Learning Research 15, section 4.1.
        """
        result = self._to_numbers([body], [level])
        _, explained = self._relate(result)
        left = 1.0 + self._parameters[3] + _SMALLEST_SPREAD - float(np.sum(explained**2))
        count = len(self._weights)
        root = np.zeros((count + 1, count + 1))
        root[:count, :count], root[count, :count] = self._root, explained[:, 0]
        root[count, count] = np.sqrt(max(left, _SMALLEST_SPREAD))
        self._root, self._weights = root, np.append(self._weights, 0.0)
        self._known = _Levels(*(np.concatenate(pair) for pair in zip(self._known, result, strict=True)))

    def _relate(self, asked: _Levels) -> tuple[Float[np.ndarray, "B N"], Float[np.ndarray, "N B"]]:
        """Return the covariance with what is known, and what the root of that of the known explains of it."""
        shared = _compute_covariance(_compare(asked, self._known), self._parameters[:3])
        return shared, np.linalg.solve(self._root, shared.T)

    def _to_numbers(self, bodies: Sequence[BodyGenome], levels: Sequence[int]) -> _Levels:
        texts = [body.canonical_text for body in bodies]
        numbers = [self._numbers.setdefault(text, len(self._numbers)) for text in texts]
        return _Levels(np.array([_describe(text) for text in texts]), np.array(numbers), np.array(levels))

    def _solve(self, likeness: _Likeness) -> tuple[Float[np.ndarray, "N N"], Float[np.ndarray, " N"]]:
        """Return the root of the covariance, and the weights of the results."""
        covariance = _compute_covariance(likeness, self._parameters[:3])
        covariance += (self._parameters[3] + _SMALLEST_SPREAD) * np.eye(len(covariance))
        root = np.linalg.cholesky(covariance)
        return root, np.linalg.solve(root.T, np.linalg.solve(root, self._values))


def _find_likeliest(
    likeness: _Likeness, values: Float[np.ndarray, " N"]
) -> tuple[float, float, float, float]:
    """Return the parameters of the grid under which the values are likeliest, of equals the first."""
    from scipy.linalg import cho_solve, cholesky

    best, likeliest = -np.inf, (_REACHES[0], _OWN[0], _BETWEEN[0], _NOISES[0])
    near = {reach: np.exp(-0.5 * likeness.squares / reach**2) for reach in _REACHES}
    far = {between: between**likeness.levels for between in _BETWEEN}
    for reach, own, between in product(_REACHES, _OWN, _BETWEEN):
        shared = ((1.0 - own) * near[reach] + own * likeness.is_same) * far[between]
        for noise in _NOISES:
            covariance = shared + (noise + _SMALLEST_SPREAD) * np.eye(len(shared))
            root = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
            weights = cho_solve((root, True), values, check_finite=False)
            likelihood = -0.5 * float(values @ weights) - float(np.log(np.diag(root)).sum())
            if likelihood > best:
                best, likeliest = likelihood, (reach, own, between, noise)
    return likeliest


def _compare(first: _Levels, second: _Levels) -> _Likeness:
    return _Likeness(
        squares=np.sum((first.shapes[:, None] - second.shapes[None]) ** 2, axis=-1),
        is_same=first.bodies[:, None] == second.bodies[None],
        levels=np.abs(first.levels[:, None] - second.levels[None]),
    )


def _compute_covariance(likeness: _Likeness, parameters: Sequence[float]) -> Float[np.ndarray, "N M"]:
    reach, own, between = parameters
    alike = (1.0 - own) * np.exp(-0.5 * likeness.squares / reach**2) + own * likeness.is_same
    return alike * between**likeness.levels


def _find_scales(
    fitness: Float[np.ndarray, " N"], results: _Levels, last: int
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
