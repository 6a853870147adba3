"""CMA-ES with restarts where it stagnates."""

import logging
from collections.abc import Iterable

import numpy as np

from evolution._src.controllers.finding import check_genotype
from evolution._src.controllers.protocol import Controller
from evolution._src.search.cmaes import Space, Strategy
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import SAMPLE, Entry

logger = logging.getLogger(__name__)


class RestartingSearch:
    """A strategy, and when it restarts.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: EvolutionConfig) -> None:
        self._config = config
        self.controller = config.make_controller(config.find_organism())
        space = _make_space(config, self.controller)
        self.strategy = Strategy(space, config.sigma, config.population_size, config.seed)
        self._last_improvement = self._max_successes = 0

    def restart_if_stagnant(self, entries: Iterable[Entry], generation: int) -> None:
        """Restart when the number of successful trials has not risen for `restart_after` generations.

        A body that leans halfway out of the pit is a local optimum that a converged search does not leave; begun again,
        other samples lead elsewhere.
        """
        restart_after = self._config.restart_after
        if restart_after is None:
            return
        samples = [entry for entry in entries if entry.kind == SAMPLE and entry.generation == generation - 1]
        successes = sum(entry.outcome.successes for entry in samples)
        if successes > self._max_successes:
            self._max_successes, self._last_improvement = successes, generation
        if generation - self._last_improvement < restart_after:
            return
        self._max_successes, self._last_improvement = 0, generation
        self.strategy.restart(np.array(self.strategy.space.initial), self._config.sigma)
        logger.info("successes stagnate; the search restarts where it began")


def _make_space(config: EvolutionConfig, controller: Controller) -> Space:
    count = len(controller.parameters)
    initial = controller.initial if config.origin == "hint" else (0.0,) * count
    if config.initial_genotype:
        initial = config.initial_genotype
        check_genotype("initial_genotype", initial, controller)
    return Space(controller.parameters, controller.lower, controller.upper, initial, (1.0,) * count)
