"""Several populations that exchange their best genotypes around a ring, behind the interface of one.

All islands are asked at once, so that their genotypes are tried in one batch, and a run of islands is recorded,
validated and resumed like any other.

References:
    Whitley, Rana, Heckendorn (1999), The island model genetic algorithm: on separability, population size and
    convergence, Journal of Computing and Information Technology 7.
    Hansen (2011), Injecting external solutions into CMA-ES, arXiv 1110.4181.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from evolution._src.backends.outcome import Outcome
from evolution._src.errors import RunError
from evolution._src.limits import MAX_GENERATIONS
from evolution._src.search.cmaes import CmaesConfig, Space, Strategy
from reconstruction._src.base.range_checks import coerce_integers

_MAX_ISLANDS = 4096


@dataclass(frozen=True)
class IslandsConfig:
    """How many populations there are, and how often they exchange genotypes.

    Attributes:
        count: number of islands, each with `population_size` genotypes and a CMA-ES of its own; 1 means no islands.
        interval: after every so many generations, the fittest genotype of an island is injected into the next
            generation of the island after it, the last one's into the first; 0 means never.
    """

    count: int = 1
    interval: int = 5

    def __post_init__(self) -> None:
        limits = {"count": (1, _MAX_ISLANDS), "interval": (0, MAX_GENERATIONS)}
        coerce_integers(self, limits, RunError)


class Islands:
    """A CMA-ES for each island. The first one has the seed of the run, so it begins as a run without islands does.

    Args:
        islands: number and exchange.
        space: bounds and start of the genes.
        sigma: first step size of each.
        population_size: genotypes of a generation of each.
        seed: seed of all random numbers.
        config: parameters of restarts.
    """

    def __init__(
        self,
        islands: IslandsConfig,
        space: Space,
        sigma: float,
        population_size: int,
        seed: int,
        config: CmaesConfig | None = None,
    ) -> None:
        self.space, self._interval, self._generation, self._leader = space, islands.interval, 0, 0
        seeds = [seed, *np.random.SeedSequence(seed).generate_state(islands.count - 1).tolist()]
        self._islands = [Strategy(space, sigma, population_size, each, config=config) for each in seeds]

    @property
    def population_size(self) -> int:
        """Genotypes in the next generation, of all islands."""
        return sum(each.population_size for each in self._islands)

    @property
    def restarts(self) -> int:
        """Restarts of all islands."""
        return sum(each.restarts for each in self._islands)

    @property
    def sigma(self) -> float:
        """The step size of the island with the fittest genotype of the last generation."""
        return self._islands[self._leader].sigma

    @property
    def mean(self) -> Float[np.ndarray, " G"]:
        """Mean of the search distribution of that island."""
        return self._islands[self._leader].mean

    @property
    def trials_factor(self) -> float:
        """Factor on the number of trials; noise is not handled."""
        return 1.0

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Sample the next generation of each island, one after the other."""
        return np.concatenate([each.ask() for each in self._islands])

    def find_reevaluations(self, fitness: Float[np.ndarray, " P"]) -> Int[np.ndarray, " K"]:
        """Return no indices: noise is not handled."""
        return np.empty(0, dtype=int)

    def tell(
        self,
        genotypes: Float[np.ndarray, "P G"],
        fitness: Float[np.ndarray, " P"],
        reevaluated: Mapping[int, float] | None = None,
        outcomes: Sequence[Outcome] = (),
    ) -> None:
        """Update each island, then let them exchange genotypes if it is time.

        Args:
            genotypes: exactly as returned by `ask`.
            fitness: finite, higher is better.
            reevaluated: none.
            outcomes: not used.
        """
        ends = np.cumsum([each.population_size for each in self._islands])
        parts = [np.split(each, ends[:-1]) for each in (genotypes, np.asarray(fitness, dtype=float))]
        best = [own[int(np.argmax(values))] for own, values in zip(*parts, strict=True)]
        self._leader = int(np.argmax([values.max() for values in parts[1]]))
        for island, own, values in zip(self._islands, *parts, strict=True):
            island.tell(own, values)
        self._generation += 1
        if len(self._islands) > 1 and self._interval and self._generation % self._interval == 0:
            for number, genotype in enumerate(best):
                self._islands[(number + 1) % len(best)].inject(genotype)

    def widen(self, sigma: float) -> None:
        """Raise the step size of each island to at least `sigma`."""
        for each in self._islands:
            each.widen(sigma)

    def inject(self, genotype: Float[np.ndarray, " G"]) -> None:
        """Let the next generation of the first island contain a genotype from elsewhere."""
        self._islands[0].inject(genotype)

    def restart(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        """Restart all islands around a genotype."""
        for each in self._islands:
            each.restart(start, sigma)
