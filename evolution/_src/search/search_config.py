"""Parts of the configuration of a run: the search, and where and how long it runs."""

from dataclasses import dataclass, field
from pathlib import Path

from evolution._src.backends.making import BACKENDS
from evolution._src.errors import RunError
from evolution._src.limits import (
    MAX_GENERATIONS,
    MAX_GENOTYPES,
    MAX_MAGNITUDE,
    MAX_TRIALS,
    MAX_WORKERS,
    MIN_POSITIVE,
)
from evolution._src.search.cmaes import CmaesConfig
from reconstruction._src.base.range_checks import as_floats, check_choice, coerce_floats, coerce_integers

_MAX_SIGMA = 1000.0


@dataclass(frozen=True)
class SearchConfig:
    """The search for a genotype: CMA-ES, and when it restarts.

    Attributes:
        population_size: number of genotypes per generation; doubles each time CMA-ES has converged and restarts, but
            not at the restarts of `restart_after`.
        sigma: initial step size of CMA-ES.
        trials: number of trials of each genotype, under the same conditions within a generation; by default as many
            as `Randomization` has stretches of the arena.
        stage_sigma: the step size is raised to this when a stage begins or bodies become shorter, and set to this
            when the search restarts around the fittest genotype.
        restart_after: number of generations without more successful trials than in the best generation before, after
            which the search restarts: where it began, or, with `body_lengths` or `stages`, around the fittest genotype
            of the stage, to keep what was learned before. None means never.
        handle_noise: whether the number of trials rises when re-evaluation changes the order of the genotypes.
        is_start_tried: whether the first generation contains the genotype at which the search begins: CMA-ES only
            samples around it, and hinges held straight may be better than all of its neighbors.
        initial_genotype: genes at which the search begins, such as those of a champion; empty: as `origin` says.
        cmaes: restarts of CMA-ES after convergence, and limits of noise handling.
    """

    population_size: int = 12
    sigma: float = 0.5
    trials: int = 3
    stage_sigma: float = 0.15
    restart_after: int | None = 10
    handle_noise: bool = False
    is_start_tried: bool = False
    initial_genotype: tuple[float, ...] = ()
    cmaes: CmaesConfig = field(default_factory=CmaesConfig)

    def __post_init__(self) -> None:
        limits = {"population_size": (4, MAX_GENOTYPES), "trials": (1, MAX_TRIALS)}
        coerce_integers(self, limits, RunError)
        coerce_floats(self, dict.fromkeys(("sigma", "stage_sigma"), (MIN_POSITIVE, _MAX_SIGMA)), RunError)
        genes = as_floats("initial_genotype", self.initial_genotype, -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
        object.__setattr__(self, "initial_genotype", genes)
        if self.restart_after is not None:
            coerce_integers(self, {"restart_after": (1, MAX_GENERATIONS)}, RunError)


@dataclass(frozen=True)
class ExecutionConfig:
    """How long a run lasts, where it runs and where it is kept; only the backend "warp" changes its results.

    Attributes:
        generations: largest number of generations; the run stops earlier when a champion is confirmed.
        workers: number of threads, processes or actors.
        backend: "batch" (threads), "processes" or "ray"; the results are equal. "warp" tries the samples of a
            generation on a GPU in single precision, with results that are equal in distribution only; candidates for
            the champion are tried on threads by MuJoCo's C engine as always.
        address: address of an existing Ray cluster; None starts a local one.
        folder: run folder; None keeps the run in memory only.
        stop_when_solved: whether the run ends when a champion is confirmed.
    """

    generations: int = 50
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    folder: str | None = None
    stop_when_solved: bool = True

    def __post_init__(self) -> None:
        if isinstance(self.folder, Path):
            object.__setattr__(self, "folder", str(self.folder))
        limits = {"generations": (0, MAX_GENERATIONS), "workers": (1, MAX_WORKERS)}
        coerce_integers(self, limits, RunError)
        check_choice("backend", self.backend, BACKENDS, RunError)
