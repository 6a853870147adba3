"""CMA-ES behind ask and tell, bit-identically reproducible, and the search for a controller that it leads.

pycma draws from NumPy's global random state. Here each strategy owns its state and makes it the
global one only during a call, so that equal seeds and equal fitness give equal genotypes whatever
else the program draws, and replaying the same calls rebuilds the strategy exactly.

References:
    Hansen (2016), The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772.
    Auger and Hansen (2005), A restart CMA evolution strategy with increasing population size.
"""

import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from jaxtyping import Float, Shaped

from evolution._src.backends.settings import BodyConfig, EpisodeConfig, TrialConfig, take_fields
from evolution._src.backends.trials import Job, Trials
from evolution._src.controllers.finding import check_genotype
from evolution._src.controllers.protocol import Controller
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import SAMPLE, VALIDATION, Attempt, Entry, Record, Try
from evolution._src.search.validation import Champion, select_champion

logger = logging.getLogger(__name__)

_MAX_DOUBLINGS = 4
"""A restart doubles the population, at most this many times: a generation has at most 16 times its first size (Auger
and Hansen double without a limit)."""
_RESTART_RANGE = (0.25, 0.75)
"""A restart begins uniformly in this part of the range of each gene: a search that begins near a bound samples mostly
outside."""


class Strategy:
    """Ask for genotypes, tell their fitness (higher is better); a converged search restarts with twice as many."""

    def __init__(
        self,
        controller: Controller,
        start: Sequence[float] | Float[np.ndarray, " G"],
        sigma: float,
        population_size: int,
        seed: int,
    ) -> None:
        self.restarts = self._doublings = 0
        self._bounds = np.array([controller.lower, controller.upper])
        self._start, self._sigma = np.asarray(start), sigma
        self._first_population_size = population_size
        self._random_state = np.random.RandomState(seed).get_state()
        self._begin(self._start)

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
                lower, upper = self._bounds
                middle = np.random.uniform(*_RESTART_RANGE, len(lower))  # noqa: NPY002
                self._begin(lower + (upper - lower) * middle)

    def restart(self) -> None:
        """Restart where the search began, with no learned covariance and the same population size."""
        self.restarts += 1
        self._begin(self._start)

    def _begin(self, start: Float[np.ndarray, " G"]) -> None:
        options = {
            "bounds": self._bounds.tolist(),
            "CMA_stds": [1.0] * len(start),
            "popsize": self.population_size,
            "seed": np.nan,  # keep the random state
            "verbose": -10,  # read no file of signals either
            "verb_log": 0,
            "verb_disp": 0,
        }
        if len(start) == 1:
            options["maxstd"] = np.inf  # pycma 4.5 raises where it lowers the step size of a single gene
        self._strategy = _load_pycma().CMAEvolutionStrategy(start, self._sigma, options)

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


@dataclass(frozen=True)
class Run:
    """The state of a run.

    Attributes:
        config: configuration of the run.
        record: every genotype and its outcome.
        champion: its best validated genotype; None before the first generation.
        is_solved: whether a champion was confirmed.
        folder: folder of the run; None if it is in memory only.
    """

    config: EvolutionConfig
    record: Record
    champion: Champion | None
    is_solved: bool = False
    folder: Path | None = None

    @property
    def history(self) -> Shaped[np.ndarray, " generations"]:
        """Structured array, one row per generation; `history["best"]` and so on, see `record.HISTORY`."""
        return self.record.history


def make_run(config: EvolutionConfig, record: Record, names: Sequence[str], folder: Path | None) -> Run:
    """Return the state of a run with the champion of its record, the genes of which have these names."""
    entry = select_champion(record.entries)
    if entry is None:
        return Run(config, record, None, folder=folder)
    is_validated = entry.kind == VALIDATION
    champion = Champion(
        genotype=tuple(entry.genotype.tolist()),
        names=tuple(names),
        **take_fields(config, EpisodeConfig, BodyConfig),
        generation=entry.generation,
        fitness=entry.fitness,
        successes=entry.outcome.successes if is_validated else 0,
        trials=entry.outcome.trials if is_validated else 0,
    )
    is_solved = config.validation.is_solved(champion.successes, champion.trials)
    return Run(config, record, champion, is_solved, folder)


class ControllerSearch:
    """The search for the controller of one body, a generation at a time; it restarts where it stagnates."""

    due = 0  # Trials of a generation: its progress is not shown

    def __init__(self, config: EvolutionConfig) -> None:
        self._config, self._body = config, config.find_organism()
        controller = config.make_controller(self._body)
        self._names = controller.parameters
        initial = controller.initial if config.origin == "hint" else (0.0,) * len(self._names)
        if config.initial_genotype:
            initial = config.initial_genotype
            check_genotype("initial_genotype", initial, controller)
        self._strategy = Strategy(controller, initial, config.sigma, config.population_size, config.seed)
        self._last_improvement = self._max_successes = 0

    def step(self, generation: int, tries: Try) -> dict[str, float]:
        """Ask for genotypes, try them, tell their fitness and validate candidates; return columns of the history."""
        strategy, validation = self._strategy, self._config.validation
        row: dict[str, float] = {"population_size": strategy.population_size, "restarts": strategy.restarts}
        genotypes, mean = strategy.ask(), strategy.mean
        trials = self._make_trials(self._config.trials, SAMPLE, generation)
        samples = tries([Attempt(SAMPLE, index, Job(genes, trials)) for index, genes in enumerate(genotypes)])
        fitness = np.array([entry.fitness for entry in samples])
        strategy.tell(genotypes, fitness)
        candidates = validation.select_candidates(fitness, [entry.outcome for entry in samples])

        def attempt(index: int, block: int) -> Attempt:
            """Return a round of a candidate, with conditions of its own."""
            genes = mean if index == len(samples) else samples[index].genotype
            seed = (VALIDATION, generation, index + 1, block)
            return Attempt(VALIDATION, index, Job(genes, self._make_trials(validation.rounds[block], *seed)))

        validation.try_again(candidates, attempt, tries)
        row |= {"best": fitness.max(), "median": float(np.median(fitness)), "sigma": strategy.sigma}
        self._restart_if_stagnant(samples, generation + 1)
        return row | {"validated": len(candidates)}

    def _make_trials(self, count: int, kind: int, *seed: int) -> Trials:
        config, start = self._config, self._config.find_start()
        settings = take_fields(config, TrialConfig, BodyConfig)
        if kind == VALIDATION and isinstance(start, str) and start != config.validation.start:
            settings["start"] = config.validation.start  # unless the run has a place of its own
        return Trials(**settings, count=count, seed=(config.seed, kind, *seed))

    def _restart_if_stagnant(self, samples: Sequence[Entry], generation: int) -> None:
        """Restart when the number of successful trials has not risen for `restart_after` generations.

        A body that leans halfway out of the pit is a local optimum that a converged search does not leave; begun again,
        other samples lead elsewhere.
        """
        successes = sum(entry.outcome.successes for entry in samples)
        if successes > self._max_successes:
            self._max_successes, self._last_improvement = successes, generation
        restart_after = self._config.restart_after
        if restart_after is not None and generation - self._last_improvement >= restart_after:
            self._max_successes, self._last_improvement = 0, generation
            self._strategy.restart()
            logger.info("successes stagnate; the search restarts where it began")

    def make_run(self, record: Record, folder: Path | None) -> Run:
        """Return the state of the run."""
        return make_run(self._config, record, self._names, folder)
