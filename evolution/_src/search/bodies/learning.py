"""What a body learns within its lifetime: CMA-ES over the genes of its controller, in levels of growing budgets.

Every number depends on the seed of the run, the body and where its learning begins, and on nothing else: not on the
other bodies of the run, their order or the workers.

References:
    Eiben, Hart (2020), If it evolves it needs to learn, GECCO Companion.
    Jamieson, Talwalkar (2016), Non-stochastic best arm identification and hyperparameter optimization, AISTATS:
    successive halving, whose levels these are.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from evolution._src.references import MAX_GENERATIONS, MAX_GENOTYPES, MAX_TRIALS, MIN_POSITIVE
from evolution._src.search.bodies.genome import BodyGenome
from evolution._src.search.cmaes import Space, Strategy
from reconstruction._src.base.range_checks import coerce_floats, coerce_integers

_MAX_SIGMA = 1000.0
MAX_LEVELS = 10


@dataclass(frozen=True)
class LearningConfig:
    """How much a body may learn, and what counts as its fitness.

    Attributes:
        population_size: genotypes of a generation of CMA-ES.
        levels: generations that a body has learned in all at the end of each level, the start included.
        sigma: initial step size of CMA-ES, relative to the hint or the zero genotype.
        trials: trials of each genotype.
        exam_trials: trials of the best genotype at the end of a level, under conditions that are not those of learning;
            their fitness is that of the body. The best of many noisy samples would flatter it.
        is_examined_early: whether there is an exam at the end of each level; else at the end of the last alone, and
            the best fitness of learning counts before: flattering, alike for the bodies of a level, and cheap.

    Raises:
        RunError: a value is out of range, or the levels do not rise.
    """

    population_size: int = 8
    levels: tuple[int, ...] = (2, 6, 18)
    sigma: float = 0.5
    trials: int = 1
    exam_trials: int = 4
    is_examined_early: bool = True

    def __post_init__(self) -> None:
        limits = {
            "population_size": (4, MAX_GENOTYPES),
            "trials": (1, MAX_TRIALS),
            "exam_trials": (1, MAX_TRIALS),
        }
        coerce_integers(self, limits, RunError)
        coerce_floats(self, {"sigma": (MIN_POSITIVE, _MAX_SIGMA)}, RunError)
        levels = tuple(int(level) for level in self.levels)
        object.__setattr__(self, "levels", levels)
        rises = all(low < high for low, high in zip((0, *levels), levels, strict=False))
        if not 1 <= len(levels) <= MAX_LEVELS or not rises or levels[-1] > MAX_GENERATIONS:
            raise RunError(
                f"levels is {self.levels}; 1 to {MAX_LEVELS} rising numbers are needed, such as (2, 6, 18)"
            )

    def count_trials(self, level: int) -> int:
        """Return the trials of a body in a level, those of the levels before left out."""
        begin, end = ((0, *self.levels)[level + each] for each in (0, 1))
        sizes = [self.population_size] * (end - begin)
        if not begin:
            sizes[0] = 1  # the start
        is_examined = self.is_examined_early or level == len(self.levels) - 1
        return sum(sizes) * self.trials + is_examined * self.exam_trials

    def compute_promoted_share(self, level: int) -> float:
        """Return which share of the bodies of a level may learn on, so that the next level costs as much in all."""
        return min(self.count_trials(level) / self.count_trials(level + 1), 1.0)


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


class Learning:
    """The learning of one body in progress.

    Args:
        body: its genome.
        controller: its controller.
        config: how much it may learn.
        origin: "zero" or "hint", where every body begins.
        seed: seed of the run.
    """

    def __init__(
        self, body: BodyGenome, controller: Controller, config: LearningConfig, origin: str, seed: int
    ) -> None:
        self.body, self.controller = body, controller
        self.curve: list[float] = []
        self.best: Float[np.ndarray, " G"] = np.asarray(_find_start(controller, origin))
        self.best_fitness = -np.inf
        self._strategy: Strategy | None = None
        if controller.parameters:
            self._strategy = Strategy(
                _make_space(controller, self.best),
                config.sigma,
                config.population_size,
                _derive_seed(body, seed),
            )

    @property
    def generation(self) -> int:
        """Generations that are told."""
        return len(self.curve)

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Return the next generation; the one genotype of a controller without genes."""
        if self._strategy is None:
            return np.zeros((1, 0))
        return self.best[None] if self._is_at_start else self._strategy.ask()

    @property
    def _is_at_start(self) -> bool:
        """Whether the next generation is the start alone, of which the strategy is not told: CMA-ES samples around it
        only, and a row of modules may cross a pit without any control."""
        return not self.curve

    def tell(self, genotypes: Float[np.ndarray, "P G"], fitness: Float[np.ndarray, " P"]) -> None:
        """Take the fitness of a generation."""
        if self._strategy is not None and not self._is_at_start:
            self._strategy.tell(genotypes, fitness)
        index = int(np.argmax(fitness))
        self.curve.append(float(fitness[index]))
        if fitness[index] > self.best_fitness:
            self.best_fitness, self.best = float(fitness[index]), np.array(genotypes[index])


def _find_start(controller: Controller, origin: str) -> list[float]:
    """Return the genotype at which learning begins."""
    base = controller.initial if origin == "hint" else np.zeros(len(controller.parameters))
    return np.clip(base, controller.lower, controller.upper).tolist() if len(base) else []


def _make_space(controller: Controller, start: Float[np.ndarray, " G"]) -> Space:
    return Space(
        names=controller.parameters,
        lower=controller.lower,
        upper=controller.upper,
        initial=tuple(np.asarray(start).tolist()),
        spread=(1.0,) * len(controller.parameters),
    )


def _derive_seed(body: BodyGenome, seed: int) -> int:
    """Return a seed of its own for a body."""
    digest = hashlib.sha256(f"{seed};{body.canonical_text}".encode()).digest()
    return int.from_bytes(digest[:4], "little")
