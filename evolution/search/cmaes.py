"""The covariance matrix adaptation strategy behind ask and tell, reproducible to the bit.

pycma draws from NumPy's global random state. Here each strategy owns its state and lends it to the
global one only during a call, so that equal seeds and equal fitness give equal genotypes whatever
else the program draws, and replaying the same calls rebuilds the strategy exactly.

References:
    Hansen (2016), The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772.
    Auger and Hansen (2005), A restart CMA evolution strategy with increasing population size.
    Hansen, Niederberger, Guzzella, Koumoutsakos (2009), A method for handling uncertainty in
    evolutionary optimization, section II (rank changes of re-evaluated genotypes).
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType

import numpy as np

LARGEST_DOUBLING = 4
"""The population doubles at a restart at most so many times."""


@dataclass(frozen=True)
class Space:
    """What genotypes look like.

    Attributes:
        names: one name a gene.
        lower: smallest value of each gene.
        upper: largest value of each gene.
        initial: where the search begins.
        spread: width of the first sample relative to sigma, per gene.
        integers: indices of the genes that hold whole numbers.
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
        population_size: genotypes a generation; doubled at a restart, up to 16 times as many.
        seed: of everything that is drawn.
        handle_noise: measure how re-evaluation changes ranks, and ask for more trials when it does.
    """

    def __init__(
        self, space: Space, sigma: float, population_size: int, seed: int, *, handle_noise: bool = False
    ) -> None:
        self.space = space
        self.restarts = self._doublings = 0
        self._first_sigma = sigma
        self._first_population_size = population_size
        self._random_state = np.random.RandomState(seed).get_state()
        self._noise = None
        self._begin(np.asarray(space.initial), sigma)
        if handle_noise:
            self._noise = _load_pycma().NoiseHandler(len(space.names), maxevals=[1, 1, 8], parallel=True)

    @property
    def population_size(self) -> int:
        """Genotypes in the next generation."""
        return self._first_population_size * 2 ** min(self._doublings, LARGEST_DOUBLING)

    @property
    def sigma(self) -> float:
        """The step size."""
        return float(self._strategy.sigma)

    @property
    def mean(self) -> np.ndarray:
        """`[G]` centre of the search distribution."""
        return np.asarray(self._strategy.result.xfavorite)

    @property
    def trials_factor(self) -> float:
        """How many times the usual number of trials the noise calls for, at least 1."""
        return float(self._noise.evaluations) if self._noise is not None else 1.0

    def ask(self) -> np.ndarray:
        """Return the next generation, `[P, G]`."""
        with self._own_randomness():
            return np.array(self._strategy.ask())

    def find_reevaluations(self, fitness: np.ndarray) -> np.ndarray:
        """Return the indices of the genotypes to try again, none where noise is not handled."""
        if self._noise is None:
            return np.empty(0, dtype=int)
        with self._own_randomness():
            return np.asarray(self._noise.indices(list(-fitness)), dtype=int)

    def tell(self, genotypes: np.ndarray, fitness: np.ndarray, again: dict[int, float] | None = None) -> None:
        """Learn from a generation; start anew with twice the population where the search has ended.

        Args:
            genotypes: `[P, G]` exactly as asked for.
            fitness: `[P]` finite, higher is better.
            again: fitness of those that were re-evaluated, by index.
        """
        costs = list(-np.asarray(fitness, dtype=float))  # pycma minimises: the one place of negation
        with self._own_randomness():
            self._strategy.tell(list(genotypes), costs)
            if self._noise is not None and again:
                self._noise.fit = costs
                again_costs = {index: -value for index, value in again.items()}
                self._noise.fitre = [again_costs.get(index, cost) for index, cost in enumerate(costs)]
                self._noise.idx = np.array(sorted(again))
                self._noise.update_measure()
                self._strategy.sigma *= self._noise.treat()
            if self._strategy.stop():
                self.restarts += 1
                self._doublings += 1
                lower, upper = np.asarray(self.space.lower), np.asarray(self.space.upper)
                middle = np.random.uniform(0.25, 0.75, len(lower))  # noqa: NPY002
                self._begin(lower + (upper - lower) * middle, self._first_sigma)

    def widen(self, sigma: float) -> None:
        """Raise the step size to at least `sigma`, for a landscape that has changed."""
        self._strategy.sigma = max(self._strategy.sigma, sigma)

    def restart(self, start: np.ndarray, sigma: float) -> None:
        """Begin anew around a genotype, with another step size and no directions learnt; as many genotypes."""
        self.restarts += 1
        self._begin(start, sigma)

    def _begin(self, start: np.ndarray, sigma: float) -> None:
        options = {
            "bounds": [list(self.space.lower), list(self.space.upper)],
            "CMA_stds": list(self.space.spread),
            "integer_variables": list(self.space.integers),
            "popsize": self.population_size,
            "seed": np.nan,  # the state is ours
            "verbose": -10,  # nor is a signals file read
            "verb_log": 0,
            "verb_disp": 0,
        }
        self._strategy = _load_pycma().CMAEvolutionStrategy(start, sigma, options)

    @contextmanager
    def _own_randomness(self) -> Iterator[None]:
        others = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._random_state)  # noqa: NPY002
        try:
            yield
        finally:
            self._random_state = np.random.get_state()  # noqa: NPY002
            np.random.set_state(others)  # noqa: NPY002


def _load_pycma() -> ModuleType:
    """Import pycma, which takes a second: worker processes do without. It need not tell that matplotlib is absent."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Could not import matplotlib")
        import cma
    return cma
