"""CMA-ES with restarts where it stagnates, and a limit on the length of bodies that falls as shorter ones succeed."""

import logging
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from evolution._src.backends.parts import BodyConfig
from evolution._src.controllers.finding import check_genotype
from evolution._src.controllers.protocol import Controller
from evolution._src.search.cmaes import Space, Strategy
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import SAMPLE, Entry
from evolution._src.search.validation import Champion

logger = logging.getLogger(__name__)

_ROUNDING_MARGIN = 0.49
"""An integer gene extends this far beyond its smallest and largest integer, so that each has the same share of
the range: just below a half, where rounding would leave it."""


class RestartingSearch:
    """A strategy, when it restarts, and how long bodies may still be.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: EvolutionConfig) -> None:
        self._config = config
        self._max_modules = config.body.max_modules
        organism = config.body.find_organism(self._max_modules)
        self.controller = config.control.make_controller(organism, config.episode)
        space = _make_space(config, self.controller)
        self.strategy = Strategy(
            space,
            config.sigma,
            config.population_size,
            config.seed,
            handle_noise=config.handle_noise,
            config=config.cmaes,
        )
        if config.is_start_tried:
            self.strategy.inject(np.asarray(space.initial, dtype=float))
        self._first_generation = self._last_improvement = self._max_successes = 0

    def count_modules(self, genotype: Float[np.ndarray, " G"]) -> int:
        """Return the length of a genotype's body, at most the longest that is allowed now."""
        if self._config.body_lengths is None:
            return self._config.modules
        return int(np.clip(round(genotype[-1]), self._config.body_lengths[0], self._max_modules))

    def select_body(self, genotype: Float[np.ndarray, " G"]) -> BodyConfig:
        """Return the body of a genotype."""
        body = self._config.body
        return body if body.body_lengths is None else BodyConfig(self.count_modules(genotype))

    def select_controller_genes(self, genotype: Float[np.ndarray, " G"]) -> Float[np.ndarray, " C"]:
        """Return the genes of the controller, without the length of the body."""
        return genotype[: len(self.controller.parameters)]

    def widen(self, generation: int) -> None:
        """Raise the step size, as the arena has changed or bodies have become shorter."""
        self.strategy.widen(self._config.stage_sigma)
        self._first_generation = self._last_improvement = generation
        self._max_successes = 0

    def limit_length(self, champion: Champion, generation: int) -> None:
        """Allow only bodies shorter than a champion that succeeds reliably."""
        if self._config.body_lengths is None or champion.modules > self._max_modules:
            return
        validation = self._config.validation
        if champion.trials >= validation.trials and champion.score >= validation.success_threshold:
            self._max_modules = max(champion.modules - 1, self._config.body_lengths[0])
            self.widen(generation)
            logger.info("%d modules suffice; at most %d from now on", champion.modules, self._max_modules)

    def restart_if_stagnant(self, entries: Iterable[Entry], generation: int) -> None:
        """Restart when the number of successful trials has not risen for `restart_after` generations.

        A body that leans halfway out of the pit is a local optimum that a converged search does not leave. A search for
        a controller restarts where it began: other samples lead elsewhere. A search among shorter and shorter bodies,
        or in finer arenas, keeps what was learned before: it restarts around the fittest genotype since the last
        change, often one that crossed once, by luck.
        """
        restart_after = self._config.restart_after
        if restart_after is None:
            return
        samples = [
            entry for entry in entries if entry.kind == SAMPLE and entry.generation >= self._first_generation
        ]
        successes = sum(entry.outcome.successes for entry in samples if entry.generation == generation - 1)
        if successes > self._max_successes:
            self._max_successes, self._last_improvement = successes, generation
        if generation - self._last_improvement < restart_after:
            return
        self._max_successes, self._last_improvement = 0, generation
        if self._config.body_lengths is None and not self._config.stages:
            self.strategy.restart(np.array(self.strategy.space.initial), self._config.sigma)
            logger.info("successes stagnate; the search restarts where it began")
            return
        fittest = max(samples, key=lambda entry: entry.fitness)
        self.strategy.restart(fittest.genotype, self._config.stage_sigma)
        logger.info(
            "successes stagnate; the search restarts around genotype %d of generation %d",
            fittest.index,
            fittest.generation,
        )


def _make_space(config: EvolutionConfig, controller: Controller) -> Space:
    count = len(controller.parameters)
    initial = controller.initial if config.origin == "hint" else (0.0,) * count
    if config.initial_genotype:
        initial = config.initial_genotype
        check_genotype("initial_genotype", initial, controller)
    space = Space(controller.parameters, controller.lower, controller.upper, initial, (1.0,) * count)
    if config.body_lengths is None:
        return space
    shortest, longest = config.body_lengths
    return Space(
        names=(*space.names, "modules"),
        lower=(*space.lower, shortest - _ROUNDING_MARGIN),
        upper=(*space.upper, longest + _ROUNDING_MARGIN),
        initial=(*space.initial, (shortest + longest) / 2),
        # times sigma, the standard deviation of the first lengths is a quarter of their range
        spread=(*space.spread, (longest - shortest) / (4 * config.sigma)),
        integers=(count,),
    )
