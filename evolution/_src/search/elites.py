"""MAP-Elites over controllers of one body: the fittest genotype of each kind of behavior, behind ask and tell.

References:
    Mouret, Clune (2015), Illuminating search spaces by mapping elites, arXiv 1504.04909.
    Vassiliades, Mouret (2018), Discovering the elite hypervolume by leveraging interspecies correlation, GECCO,
    section 4: the directional variation.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from evolution._src.backends.outcome import Outcome
from evolution._src.search.archive import ArchiveConfig, make_archive
from evolution._src.search.cmaes import Space


class Elites:
    """MAP-Elites: the first generation is sampled around the start, all others are varied elites.

    Args:
        archive: grid and variation.
        space: bounds and start of the genes.
        sigma: of the first generation, in units of `space.spread`.
        population_size: genotypes of a generation.
        seed: seed of all random numbers.
    """

    def __init__(
        self, archive: ArchiveConfig, space: Space, sigma: float, population_size: int, seed: int
    ) -> None:
        self.space, self.population_size, self.sigma, self.restarts = space, population_size, sigma, 0
        self._config, self._rng = archive, np.random.default_rng(seed)
        self._lower, self._upper = np.asarray(space.lower), np.asarray(space.upper)
        self._cells = make_archive(archive, len(space.names))
        self._injected: list[Float[np.ndarray, " G"]] = []

    @property
    def mean(self) -> Float[np.ndarray, " G"]:
        """The fittest elite; the start of the search while there is none."""
        if not self._cells.stats.num_elites:
            return np.asarray(self.space.initial, dtype=float)
        return np.asarray(self._cells.best_elite["solution"])

    @property
    def trials_factor(self) -> float:
        """Factor on the number of trials; noise is not handled."""
        return 1.0

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Return genotypes for the next generation."""
        genotypes = self._draw()
        for index, genotype in enumerate(self._injected[: len(genotypes)]):
            genotypes[index] = genotype
        self._injected = []
        return genotypes

    def _draw(self) -> Float[np.ndarray, "P G"]:
        shape = self.population_size, len(self._lower)
        if not self._cells.stats.num_elites:
            spread = self.sigma * np.asarray(self.space.spread)
            return self._clip(np.asarray(self.space.initial) + spread * self._rng.normal(size=shape))
        elites = np.asarray(self._cells.data("solution"))
        parents, others = elites[self._rng.integers(len(elites), size=(2, self.population_size))]
        step = self._config.noise * (self._upper - self._lower) * self._rng.normal(size=shape)
        share = self._config.line * self._rng.normal(size=(self.population_size, 1))
        return self._clip(parents + step + share * (others - parents))

    def _clip(self, genotypes: Float[np.ndarray, "P G"]) -> Float[np.ndarray, "P G"]:
        return np.clip(genotypes, self._lower, self._upper)

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
        """Offer genotypes to the archive; those that could not be tried are left out.

        Args:
            genotypes: as returned by `ask`.
            fitness: finite, higher is better.
            reevaluated: none.
            outcomes: of each genotype.
        """
        for genotype, value, outcome in zip(genotypes, fitness, outcomes, strict=True):
            if not outcome.error:
                self._cells.add_single(genotype, value, self._config.measure(outcome))

    def inject(self, genotype: Float[np.ndarray, " G"]) -> None:
        """Let the next generation contain a genotype from elsewhere."""
        self._injected.append(np.clip(genotype, self._lower, self._upper))

    def widen(self, sigma: float) -> None:
        """Do nothing: an archive has no step size."""

    def restart(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        """Do nothing: an archive does not converge."""
