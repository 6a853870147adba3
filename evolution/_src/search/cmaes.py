"""The covariance matrix adaptation strategy behind ask and tell, bit-identically reproducible.

pycma draws from NumPy's global random state. Here each strategy owns its state and makes it the
global one only during a call, so that equal seeds and equal fitness give equal genotypes whatever
else the program draws, and replaying the same calls rebuilds the strategy exactly.

References:
    Hansen (2016), The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772.
    Auger and Hansen (2005), A restart CMA evolution strategy with increasing population size.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from jaxtyping import Float

_MAX_DOUBLINGS = 4
"""A restart doubles the population, at most this many times: a generation has at most 16 times its first size (Auger
and Hansen double without a limit)."""
_RESTART_RANGE = (0.25, 0.75)
"""A restart begins uniformly in this part of the range of each gene: a search that begins near a bound samples mostly
outside."""


@dataclass(frozen=True)
class Space:
    """The space of genotypes."""

    names: tuple[str, ...]  # one for each gene
    lower: tuple[float, ...]  # smallest value of each gene
    upper: tuple[float, ...]  # largest value of each gene
    initial: tuple[float, ...]  # genotype at which the search begins
    spread: tuple[float, ...]  # width of the first sample relative to sigma, per gene

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
    """

    def __init__(
        self,
        space: Space,
        sigma: float,
        population_size: int,
        seed: int,
    ) -> None:
        self.space = space
        self.restarts = self._doublings = 0
        self._first_sigma = sigma
        self._first_population_size = population_size
        self._random_state = np.random.RandomState(seed).get_state()
        self._begin(np.asarray(space.initial), sigma)

    @property
    def population_size(self) -> int:
        """Genotypes in the next generation."""
        return self._first_population_size * 2 ** min(self._doublings, _MAX_DOUBLINGS)

    @property
    def sigma(self) -> float:
        """The step size."""
        return float(self._strategy.sigma)

    @property
    def mean(self) -> Float[np.ndarray, " G"]:
        """Mean of the search distribution."""
        return np.asarray(self._strategy.result.xfavorite)

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Sample the next generation."""
        with self._own_random_state():
            return np.array(self._strategy.ask())

    def tell(self, genotypes: Float[np.ndarray, "P G"], fitness: Float[np.ndarray, " P"]) -> None:
        """Update the distribution; restart with twice the population where the search has converged."""
        costs = list(-np.asarray(fitness, dtype=float))  # pycma minimizes: the one place of negation
        with self._own_random_state():
            self._strategy.tell(list(genotypes), costs)
            if self._strategy.stop():
                self.restarts += 1
                self._doublings += 1
                lower, upper = np.asarray(self.space.lower), np.asarray(self.space.upper)
                middle = np.random.uniform(*_RESTART_RANGE, len(lower))  # noqa: NPY002
                self._begin(lower + (upper - lower) * middle, self._first_sigma)

    def inject(self, genotype: Float[np.ndarray, " G"]) -> None:
        """Let the next generation contain a genotype from elsewhere, as its first one.

        References:
            Hansen (2011), Injecting external solutions into CMA-ES, arXiv 1110.4181.
        """
        inverse = self._strategy.boundary_handler.inverse
        self._strategy.inject([self._strategy.gp.geno(genotype, from_bounds=inverse)], force=True)

    def restart(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        """Restart around a genotype with another step size, no learned covariance and the same population size."""
        self.restarts += 1
        self._begin(start, sigma)

    def _begin(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        options = {
            "bounds": [list(self.space.lower), list(self.space.upper)],
            "CMA_stds": list(self.space.spread),
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
