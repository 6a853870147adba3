"""Where the search of a run stands: which genotypes it draws, which bodies it may still try, when it begins anew."""

import logging
from collections.abc import Iterable

import numpy as np

from evolution.controllers.controller import Controller, make_controller
from evolution.search.cmaes import Space, Strategy
from evolution.search.config import EvolutionConfig
from evolution.search.record import SAMPLE, Entry
from evolution.search.validation import HOLDS, Champion

log = logging.getLogger(__name__)


class Search:
    """A strategy, and the task it has now: an arena, and bodies of at most some length.

    Args:
        config: of the run.
    """

    def __init__(self, config: EvolutionConfig) -> None:
        self._config = config
        self._longest = config.body_lengths[1] if config.body_lengths else config.modules
        self.controller = make_controller(config.controller, self._longest)
        self.strategy = Strategy(
            _make_space(config, self.controller),
            config.sigma,
            config.population_size,
            config.seed,
            handle_noise=config.handle_noise,
        )
        self._task_began = self._improved = self._most_held = 0

    def count_modules(self, genotype: np.ndarray) -> int:
        """Return how long a body the genotype asks for, as far as it is allowed."""
        if self._config.body_lengths is None:
            return self._config.modules
        return int(np.clip(round(genotype[-1]), self._config.body_lengths[0], self._longest))

    def strip(self, genotype: np.ndarray) -> np.ndarray:
        """Return the genes of the controller alone."""
        return genotype[: len(self.controller.parameters)]

    def begin_task(self, generation: int) -> None:
        """Search with a wider step: the arena is another one, or bodies are shorter."""
        self.strategy.widen(self._config.stage_sigma)
        self._task_began = self._improved = generation
        self._most_held = 0

    def shorten(self, champion: Champion, generation: int) -> None:
        """Let no body be as long as one that holds, so that the search is for shorter ones."""
        if self._config.body_lengths is None or champion.modules > self._longest:
            return
        if champion.trials >= self._config.validation.trials and champion.score >= HOLDS:
            self._longest = max(champion.modules - 1, self._config.body_lengths[0])
            self.begin_task(generation)
            log.info("%d modules hold; bodies of at most %d from now on", champion.modules, self._longest)

    def restart_if_stuck(self, entries: Iterable[Entry], generation: int) -> None:
        """Begin anew when successes have not become more for long.

        A body that leans halfway out of the pit is a local optimum that a settled search does not leave. A search for
        a controller begins where it began: other samples lead elsewhere. One among shorter and shorter bodies, or in
        finer arenas, keeps what was learned before: it begins around the fittest genotype of this task, often one that
        crossed once, by luck.

        Args:
            entries: all of the run.
            generation: the next one.
        """
        patience = self._config.restart_after
        if patience is None:
            return
        known = [entry for entry in entries if entry.kind == SAMPLE and entry.generation >= self._task_began]
        held = sum(entry.outcome.successes for entry in known if entry.generation == generation - 1)
        if held > self._most_held:
            self._most_held, self._improved = held, generation
        if generation - self._improved < patience:
            return
        self._most_held, self._improved = 0, generation
        if self._config.body_lengths is None and not self._config.stages:
            self.strategy.restart(np.array(self.strategy.space.initial), self._config.sigma)
            log.info("no more succeed; the search begins anew")
            return
        fittest = max(known, key=lambda entry: entry.fitness)
        self.strategy.restart(fittest.genotype, self._config.stage_sigma)
        log.info(
            "no more succeed; anew around genotype %d of generation %d", fittest.index, fittest.generation
        )


def _make_space(config: EvolutionConfig, controller: Controller) -> Space:
    count = len(controller.parameters)
    initial = controller.initial if config.origin == "hint" else (0.0,) * count
    space = Space(controller.parameters, controller.lower, controller.upper, initial, (1.0,) * count)
    if config.body_lengths is None:
        return space
    shortest, longest = config.body_lengths
    return Space(
        names=(*space.names, "modules"),
        lower=(*space.lower, shortest - 0.49),
        upper=(*space.upper, longest + 0.49),
        initial=(*space.initial, (shortest + longest) / 2),
        spread=(*space.spread, (longest - shortest) / (4 * config.sigma)),
        integers=(count,),
    )
