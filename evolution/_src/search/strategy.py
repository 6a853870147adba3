"""What searches for genotypes, by the configuration: CMA-ES, islands of it, or MAP-Elites."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int

from evolution._src.backends.outcome import Outcome
from evolution._src.search.cmaes import Space, Strategy
from evolution._src.search.elites import Elites
from evolution._src.search.islands import Islands
from evolution._src.search.search_config import SearchConfig


class SearchStrategy(Protocol):
    """Ask for genotypes, tell their fitness; equal calls give equal genotypes, so that replaying them rebuilds it."""

    space: Space

    @property
    def population_size(self) -> int:
        """Genotypes in the next generation."""
        ...

    @property
    def restarts(self) -> int:
        """Restarts so far."""
        ...

    @property
    def sigma(self) -> float:
        """The step size."""
        ...

    @property
    def mean(self) -> Float[np.ndarray, " G"]:
        """A genotype that stands for the search so far, and is a candidate for the champion."""
        ...

    @property
    def trials_factor(self) -> float:
        """Factor on the number of trials, at least 1."""
        ...

    def ask(self) -> Float[np.ndarray, "P G"]:
        """Sample the next generation."""
        ...

    def find_reevaluations(self, fitness: Float[np.ndarray, " P"]) -> Int[np.ndarray, " K"]:
        """Return the indices of the genotypes to re-evaluate."""
        ...

    def tell(
        self,
        genotypes: Float[np.ndarray, "P G"],
        fitness: Float[np.ndarray, " P"],
        reevaluated: Mapping[int, float] | None = None,
        outcomes: Sequence[Outcome] = (),
    ) -> None:
        """Update the search.

        Args:
            genotypes: exactly as returned by `ask`.
            fitness: finite, higher is better.
            reevaluated: second fitness of those that were re-evaluated, by index.
            outcomes: of each genotype.
        """
        ...

    def widen(self, sigma: float) -> None:
        """Raise the step size to at least `sigma`."""
        ...

    def restart(self, start: Float[np.ndarray, " G"], sigma: float) -> None:
        """Restart around a genotype."""
        ...

    def inject(self, genotype: Float[np.ndarray, " G"]) -> None:
        """Let the next generation contain a genotype from elsewhere, as its first one."""
        ...


def make_strategy(config: SearchConfig, space: Space, seed: int) -> SearchStrategy:
    """Make the search of a run.

    Args:
        config: of the search.
        space: bounds and start of the genes.
        seed: of all random numbers.

    Raises:
        MissingExtraError: MAP-Elites needs the extra `ribs`, which is not installed.
    """
    strategy = _make_strategy(config, space, seed)
    if config.is_start_tried:
        strategy.inject(np.asarray(space.initial, dtype=float))
    return strategy


def _make_strategy(config: SearchConfig, space: Space, seed: int) -> SearchStrategy:
    if config.archive.axes:
        return Elites(config.archive, space, config.sigma, config.population_size, seed)
    if config.islands.count > 1:
        return Islands(config.islands, space, config.sigma, config.population_size, seed, config.cmaes)
    return Strategy(
        space,
        config.sigma,
        config.population_size,
        seed,
        handle_noise=config.handle_noise,
        config=config.cmaes,
    )
