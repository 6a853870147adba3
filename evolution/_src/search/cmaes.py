"""The covariance matrix adaptation strategy behind ask and tell, reproducible to the bit.

pycma draws from NumPy's global random state. Here each strategy owns its state and makes it the
global one only during a call, so that equal seeds and equal fitness give equal genotypes whatever
else the program draws, and replaying the same calls rebuilds the strategy exactly.

References:
    Hansen (2016), The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772.
    Auger and Hansen (2005), A restart CMA evolution strategy with increasing population size.
    Hansen, Niederberger, Guzzella, Koumoutsakos (2009), A method for handling uncertainty in
    evolutionary optimization, section II (rank changes of re-evaluated genotypes).
"""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float, Int, Shaped

from evolution._src.errors import RunError
from evolution._src.references import MAX_GENERATIONS, MAX_TRIALS, MIN_POSITIVE
from reconstruction._src.base.range_checks import as_range, check_choice, coerce_floats, coerce_integers

_MAX_DOUBLINGS = 16


@dataclass(frozen=True)
class CmaesConfig:
    """How the strategy restarts by itself, and how many more trials noise may cause.

    Attributes:
        max_doublings: a restart doubles the population, at most this many times; 4 bound a generation to 16 times
            its first size (Auger and Hansen double without a limit).
        restart_range: where a restart begins: uniform in this part of the range of each gene. The outer quarters
            are left out, since a search that begins near a bound samples mostly outside.
        max_trials_factor: noise handling multiplies the number of trials by at most this.
    """

    max_doublings: int = 4
    restart_range: tuple[float, float] = (0.25, 0.75)
    max_trials_factor: int = 8

    def __post_init__(self) -> None:
        coerce_integers(
            self, {"max_doublings": (0, _MAX_DOUBLINGS), "max_trials_factor": (1, MAX_TRIALS)}, RunError
        )
        object.__setattr__(
            self, "restart_range", as_range("restart_range", self.restart_range, 0.0, 1.0, RunError)
        )


@dataclass(frozen=True)
class Space:
    """The space of genotypes.

    Attributes:
        names: one for each gene.
        lower: smallest value of each gene.
        upper: largest value of each gene.
        initial: genotype at which the search begins.
        spread: width of the first sample relative to sigma, per gene.
        integers: indices of the genes that are integers.
    """

    names: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    initial: tuple[float, ...]
    spread: tuple[float, ...]
    integers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        sizes = {len(self.names), len(self.lower), len(self.upper), len(self.initial), len(self.spread)}
        if len(sizes) != 1:
            raise ValueError(f"names, bounds, initial and spread differ in length: {sorted(sizes)}")


class Strategy:
    """Ask for genotypes, tell their fitness (higher is better).

    Args:
        space: bounds and start of the genes.
        sigma: first step size, in units of `space.spread`.
        population_size: genotypes of a generation; doubled at a restart.
        seed: seed of all random numbers.
        handle_noise: measure how re-evaluation changes ranks, and ask for more trials when it does.
        config: parameters of restarts and noise handling.
    """

    def __init__(
        self,
        space: Space,
        sigma: float,
        population_size: int,
        seed: int,
        *,
        handle_noise: bool = False,
        config: CmaesConfig | None = None,
    ) -> None:
        self.space = space
        self._config = config or CmaesConfig()
        self.restarts = self._doublings = 0
        self._first_sigma = sigma
        self._first_population_size = population_size
        self._random_state = np.random.RandomState(seed).get_state()
        self._noise = None
        self._begin(np.asarray(space.initial), sigma)
        if handle_noise:
            evaluations = [1, 1, self._config.max_trials_factor]  # at the start, at least, at most
            self._noise = _load_pycma().NoiseHandler(len(space.names), maxevals=evaluations, parallel=True)

    @property
    def population_size(self) -> int:
        """Genotypes in the next generation."""
        return self._first_population_size * 2 ** min(self._doublings, self._config.max_doublings)

    @property
    def sigma(self) -> float:
        """The step size."""
        return float(self._strategy.sigma)

    @property
    def mean(self) -> Float[np.ndarray, " G"]:
        """Mean of the search distribution."""
        return np.asarray(self._strategy.result.xfavorite)

    @property
    def trials_factor(self) -> float:
        """Factor on the number of trials that the noise requires, at least 1."""
        return float(self._noise.evaluations) if self._noise is not None else 1.0

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Sample the next generation."""
        with self._own_random_state():
            return np.array(self._strategy.ask())

    def find_reevaluations(self, fitness: Float[np.ndarray, " P"]) -> Int[np.ndarray, " K"]:
        """Return the indices of the genotypes to re-evaluate, none where noise is not handled."""
        if self._noise is None:
            return np.empty(0, dtype=int)
        with self._own_random_state():
            return np.asarray(self._noise.indices(list(-fitness)), dtype=int)

    def tell(
        self,
        genotypes: Float[np.ndarray, "P G"],
        fitness: Float[np.ndarray, " P"],
        reevaluated: Mapping[int, float] | None = None,
    ) -> None:
        """Update the distribution; restart with twice the population where the search has converged."""
        costs = list(-np.asarray(fitness, dtype=float))  # pycma minimizes: the one place of negation
        with self._own_random_state():
            self._strategy.tell(list(genotypes), costs)
            if self._noise is not None and reevaluated:
                self._noise.fit = costs
                second_costs = {index: -value for index, value in reevaluated.items()}
                self._noise.fitre = [second_costs.get(index, cost) for index, cost in enumerate(costs)]
                self._noise.idx = np.array(sorted(reevaluated))
                self._noise.update_measure()
                self._strategy.sigma *= self._noise.treat()
            if self._strategy.stop():
                self.restarts += 1
                self._doublings += 1
                lower, upper = np.asarray(self.space.lower), np.asarray(self.space.upper)
                middle = np.random.uniform(*self._config.restart_range, len(lower))  # noqa: NPY002
                self._begin(lower + (upper - lower) * middle, self._first_sigma)

    def inject(self, genotype: Float[np.ndarray, " G"]) -> None:
        """Let the next generation contain a genotype from elsewhere, as its first one.

        References:
            Hansen (2011), Injecting external solutions into CMA-ES, arXiv 1110.4181.
        """
        inverse = self._strategy.boundary_handler.inverse
        self._strategy.inject([self._strategy.gp.geno(genotype, from_bounds=inverse)], force=True)

    def widen(self, sigma: float) -> None:
        """Raise the step size to at least `sigma`, for a landscape that has changed."""
        self._strategy.sigma = max(self._strategy.sigma, sigma)

    def restart(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        """Restart around a genotype with another step size, no learned covariance and the same population size."""
        self.restarts += 1
        self._begin(start, sigma)

    def _begin(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        options = {
            "bounds": [list(self.space.lower), list(self.space.upper)],
            "CMA_stds": list(self.space.spread),
            "integer_variables": list(self.space.integers),
            "popsize": self.population_size,
            "seed": np.nan,  # keep the random state
            "verbose": -10,  # read no file of signals either
            "verb_log": 0,
            "verb_disp": 0,
        }
        if len(self.space.names) == 1:
            options["maxstd"] = np.inf  # pycma 4.5 raises where it lowers the step size of a single gene
        self._strategy = _load_pycma().CMAEvolutionStrategy(start, sigma, options)

    @contextmanager
    def _own_random_state(self) -> Iterator[None]:
        global_state = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._random_state)  # noqa: NPY002
        try:
            yield
        finally:
            self._random_state = np.random.get_state()  # noqa: NPY002
            np.random.set_state(global_state)  # noqa: NPY002


def _load_pycma() -> ModuleType:
    """Import pycma, which takes a second and is not needed by workers; without its warning about matplotlib."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Could not import matplotlib")
        import cma
    return cma


Promotion = Literal["success", "stagnation", "either", "budget"]
PROMOTIONS: tuple[Promotion, ...] = get_args(Promotion)


@dataclass(frozen=True)
class Stage:
    """A part of a run, in one arena. The last stage lasts until the run ends.

    Attributes:
        arena: name or folder.
        generations: largest number; None means no limit.
        promotion: condition that ends the stage early: "success" (enough genotypes succeed), "stagnation" (the best
            no longer improves), "either", or "budget" (nothing).
        success_share: share of a generation's genotypes that must succeed in all their trials.
        patience: generations without improvement that count as stagnation.
        trials: number of trials of each genotype in this stage; None means as many as in the run. One is enough in a
            coarse arena, which only shows where to search.
    """

    arena: str
    generations: int | None = None
    promotion: Promotion = "either"
    success_share: float = 0.25
    patience: int = 10
    trials: int | None = None

    def __post_init__(self) -> None:
        if isinstance(self.arena, PathLike):
            object.__setattr__(self, "arena", str(Path(self.arena)))
        check_choice("promotion", self.promotion, PROMOTIONS, RunError)
        optional = {"generations": (1, MAX_GENERATIONS), "trials": (1, MAX_TRIALS)}
        coerce_integers(
            self,
            {name: limits for name, limits in optional.items() if getattr(self, name) is not None},
            RunError,
        )
        coerce_integers(self, {"patience": (1, MAX_GENERATIONS)}, RunError)
        coerce_floats(self, {"success_share": (MIN_POSITIVE, 1.0)}, RunError)
        if self.generations is None and self.promotion == "budget":
            raise RunError("a stage promoted by budget needs a number of generations")

    def is_done(self, history: Shaped[np.ndarray, " generations"]) -> bool:
        """Return whether the stage ends after these generations of its own (rows of a run's history)."""
        if not len(history):
            return False
        if self.generations is not None and len(history) >= self.generations:
            return True
        last = history[-1]
        succeeds = last["successes"] >= self.success_share * last["population_size"]
        stagnates = len(history) > self.patience and (
            history["best"][-self.patience :].max() <= history["best"][: -self.patience].max()
        )
        return bool(
            (succeeds and self.promotion in ("success", "either"))
            or (stagnates and self.promotion in ("stagnation", "either"))
        )
