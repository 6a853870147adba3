"""The baselines of the suite: no effort, and chance and CMA-ES over the genes of two laws."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.pool import Simulate
from evolution._src.backends.settings import read_organism
from evolution._src.backends.trials import Job, Trials, check_tried, find_trial_controller
from evolution._src.errors import RunError
from evolution._src.search.cmaes import Strategy
from evolution._src.search.run import describe_origin
from evolution._src.suite.exam import SCORING
from evolution._src.suite.submission import Entry, Submission, fill_submission
from evolution._src.suite.tasks import BUDGET, SEEDS, SUITE, SuiteTask, find_suite_task
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.robot.body_plans import organism_to_text

POPULATION = 8  # Genotypes of a generation
SIGMA = 0.5  # Initial step size of CMA-ES, and spread of random genotypes
LEARNING_SEED = 22  # Of the conditions while learning, with the number of the generation
SEARCH_SHARE = 0.8
"""Of the budget; with the rest the best genotypes are tried again, as one trial is mostly luck."""
FINALISTS, FINAL_TRIALS = 5, 5  # The fittest genotypes of the search, and how often each is tried again


class Practice:
    """A task, a budget of simulated time [s] and the genotypes of a law that were tried in the scanned arena.

    Each generation has conditions of its own, equal for its genotypes. A generation that has begun is finished.
    """

    def __init__(self, task: SuiteTask, law: str, backend: Backend, budget: float) -> None:
        self.task, self.law, self.backend, self.budget = task, law, backend, budget
        self.seconds, self.generation = 0.0, 0
        self.tried: list[tuple[float, Float[np.ndarray, " G"]]] = []  # fitness and genes
        self.controller = find_trial_controller(self._make_trials())

    def has_time(self) -> bool:
        """Return whether the search has not spent its share of the budget."""
        return self.seconds < SEARCH_SHARE * self.budget

    def try_all(self, genotypes: Float[np.ndarray, "P G"], count: int = 1) -> Float[np.ndarray, " P"]:
        """Try each genotype, and return the fitness of each."""
        self.generation += 1
        trials = self._make_trials(count)
        outcomes = self.backend.run([Job(genotype, trials) for genotype in genotypes])
        if not self.tried:
            check_tried(outcomes)
        self.seconds += sum(outcome.seconds for outcome in outcomes)
        fitness = [SCORING.score(outcome, 0) for outcome in outcomes]
        self.tried += zip(fitness, np.array(genotypes), strict=True)
        return np.array(fitness)

    def choose(self) -> Float[np.ndarray, " G"]:
        """Try the fittest genotypes again, as many as there is time for, and return the best of them."""
        usual = FINAL_TRIALS * self.seconds / len(self.tried)  # time that one takes
        count = int(np.clip((self.budget - self.seconds) / max(usual, 1e-9), 1, FINALISTS))
        order = np.argsort([-fitness for fitness, _ in self.tried], kind="stable")[:count]
        finalists = np.array([self.tried[index][1] for index in order])
        if len(finalists) == 1:
            return finalists[0]
        return finalists[int(np.argmax(self.try_all(finalists, FINAL_TRIALS)))]

    def _make_trials(self, count: int = 1) -> Trials:
        seed = (LEARNING_SEED, self.generation)
        return self.task.make_trials(self.task.find_scan(), self.task.body, self.law, count, seed)


def _run_zero(practice: Practice, rng: np.random.Generator) -> None:
    """Try the zero genotype: tracks full speed ahead, hinges straight."""
    practice.try_all(np.zeros((1, len(practice.controller.parameters))))


def _run_random(practice: Practice, rng: np.random.Generator) -> None:
    """Draw genotypes around zero."""
    law = practice.controller
    while practice.has_time():
        genotypes = rng.normal(0.0, SIGMA, (POPULATION, len(law.parameters)))
        practice.try_all(np.clip(genotypes, law.lower, law.upper))


def _run_cmaes(practice: Practice, rng: np.random.Generator) -> None:
    """Let CMA-ES learn from zero; the zero genotype, around which it samples only, is tried first."""
    law, genes = practice.controller, len(practice.controller.parameters)
    strategy = Strategy(law, (0.0,) * genes, SIGMA, POPULATION, int(rng.integers(2**31)))
    practice.try_all(np.zeros((1, genes)))
    while practice.has_time():
        genotypes = strategy.ask()
        strategy.tell(genotypes, practice.try_all(genotypes))


METHODS: Mapping[str, tuple[str, Callable[[Practice, np.random.Generator], None]]] = {
    "zero": ("oscillators", _run_zero),
    "random": ("oscillators", _run_random),
    "cmaes": ("oscillators", _run_cmaes),
    "random-path": ("path", _run_random),
    "path": ("path", _run_cmaes),
}
"""Law and search of the baselines by name: each spends the budget of a practice, which chooses the best genotype."""


def run_baseline(name: str, task: SuiteTask, seed: int, backend: Backend, budget: float) -> Entry:
    """Return what a baseline finds for a task."""
    law, search = METHODS[name]
    practice = Practice(task, law, backend, budget)
    search(practice, np.random.default_rng((seed, *task.name.encode(), *name.encode())))
    genes = tuple(float(gene) for gene in practice.choose())
    plan = organism_to_text(read_organism(task.body))
    return Entry(task.name, seed, plan, law, genes, practice.seconds)


def run_suite(
    method: str,
    seeds: Sequence[int] = (),
    tasks: Sequence[str] = (),
    budget: float = BUDGET,
    workers: int = 1,
    progress: Progress = silent,
    simulate: Simulate | None = None,
    out: Path | None = None,
) -> Submission:
    """Return what a baseline finds for tasks, all unless some are named, with all their seeds unless given."""
    check_choice("method", method, tuple(METHODS), RunError)
    chosen = [find_suite_task(name) for name in tasks] or SUITE
    backend = make_backend("batch", workers, simulate=simulate)
    try:
        return fill_submission(
            method if budget == BUDGET else f"{method}, {budget:g} s",
            lambda task, seed: run_baseline(method, task, seed, backend, budget),
            sorted(((task, seed) for task in chosen for seed in seeds or SEEDS), key=lambda pair: pair[1]),
            describe_origin() | {"method": method, "budget": budget},
            out,
            progress,
        )
    finally:
        backend.close()
