"""The configuration of a run: an episode, the fitness, what it searches for, where it runs and where it is kept."""

import hashlib
import json
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, ClassVar

from evolution._src.backends.cluster import BACKENDS, LOCAL_BACKENDS
from evolution._src.backends.scoring import Scoring, find_scoring
from evolution._src.backends.settings import BodyConfig, TrialConfig
from evolution._src.controllers.finding import check_genotype, refer_to_controller
from evolution._src.errors import RunError
from evolution._src.references import (
    MAX_GENERATIONS,
    MAX_GENOTYPES,
    MAX_MAGNITUDE,
    MAX_SEED,
    MAX_TRIALS,
    MAX_WORKERS,
    MIN_POSITIVE,
)
from evolution._src.search.validation import Validation
from reconstruction._src.base.range_checks import (
    as_floats,
    check_choice,
    coerce_floats,
    coerce_integers,
    format_count,
)
from symbrion_gym._src.environment.config import count_tracks
from symbrion_gym._src.robot.organism import Organism

MAX_SIGMA = 1000.0


@dataclass(frozen=True, kw_only=True)
class RunConfig(TrialConfig):
    """A run that a folder keeps.

    Attributes:
        seed: seed of all random numbers of the run.
        scoring: how an outcome becomes a fitness: the weights of a `Scoring`, a function of (outcome, body), or
            "module:name" of one.
        workers: number of threads, processes or tasks.
        backend: "batch" (threads), "processes" or "ray"; the results are equal.
        address: address of an existing Ray cluster; None starts a local one.
        folder: run folder; None keeps the run in memory only.
    """

    RUNTIME: ClassVar[tuple[str, ...]] = ("workers", "backend", "address", "folder")
    """Fields that may change when a run is resumed: they decide its length and where it runs, not its results."""
    POSSIBLE_BACKENDS: ClassVar[tuple[str, ...]] = BACKENDS
    STEP: ClassVar[str] = "generation"  # What is counted, by the field of this name and an "s"

    seed: int = 0
    scoring: Any = field(default_factory=Scoring)
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    folder: str | None = None

    def __post_init__(self) -> None:
        for name in ("arena", "folder"):
            if isinstance(getattr(self, name), PathLike):
                self._set(name, str(getattr(self, name)))
        if not isinstance(self.arena, str):
            raise RunError(
                f"arena is {type(self.arena).__name__}; a run is stored as text: save the arena in a folder and name it"
            )
        super().__post_init__()
        self._set("scoring", find_scoring(self.scoring))
        coerce_integers(self, {"seed": (0, MAX_SEED), "workers": (1, MAX_WORKERS)}, RunError)
        check_choice("backend", self.backend, self.POSSIBLE_BACKENDS, RunError)

    def _check_control(self, organism: Organism, remedy: str) -> None:
        """Find the controller of a body, which must have something to move."""
        tracks = count_tracks(self.track_control, organism.num_modules)
        if not (organism.hinges or tracks):
            raise RunError(
                f"a body of {format_count(organism.num_modules, 'module')} has no hinge; {remedy}, or drive the "
                "tracks, by the option track_control of the environment: 'skid'"
            )
        must_be_found = self.must_be_restorable
        controller = refer_to_controller(self.controller, organism, tracks, must_be_found=must_be_found)
        self._set("controller", controller)

    @property
    def must_be_restorable(self) -> bool:
        """Whether a file or other processes must find again what a user wrote."""
        return self.folder is not None or self.backend not in LOCAL_BACKENDS

    @property
    def length(self) -> int:
        """The largest number of generations or iterations."""
        return getattr(self, f"{self.STEP}s")

    def differences(self, other: "RunConfig") -> list[str]:
        """Return "field: this, not that" for each difference that decides the results of a run."""
        theirs = vars(other)
        return [
            f"{name}: {value!r}, not {theirs.get(name)!r}"
            for name, value in vars(self).items()
            if name not in self.RUNTIME and value != theirs.get(name)
        ]

    def digest(self) -> str:
        """Return a fingerprint of all that decides the results of a run."""
        content = self.to_json() | {"start": self.find_start()}
        kept = {name: value for name, value in content.items() if name not in self.RUNTIME}
        return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, kw_only=True)
class EvolutionConfig(RunConfig, BodyConfig):
    """A run of evolution: an episode, a body, the search for a genotype by CMA-ES, and where it runs.

    The run folder stores every field. What is no field is an option of the environment, such as `pit` or
    `track_control`. Length, workers and folder change no results. The backend "warp" does: it tries the samples of a
    generation on a GPU in single precision, with results that are equal in distribution only; candidates for the
    champion are tried on threads by MuJoCo's C engine as always.

    Attributes:
        population_size: number of genotypes per generation; doubles each time CMA-ES has converged and restarts, but
            not at the restarts of `restart_after`.
        sigma: initial step size of CMA-ES.
        trials: number of trials of each genotype, under the same conditions within a generation; by default as many
            as `Randomization` has stretches of the arena.
        restart_after: number of generations without more successful trials than in the best generation before, after
            which the search restarts where it began. None means never.
        initial_genotype: genes at which the search begins, such as those of a champion; empty: as `origin` says.
        validation: rules by which candidates for the champion are validated.
        generations: largest number of generations; the run stops earlier when a champion is confirmed.
        stop_when_solved: whether the run ends when a champion is confirmed.

    Raises:
        RunError: a value is out of range, or fields do not fit together; with the value and what is allowed.
    """

    RUNTIME: ClassVar[tuple[str, ...]] = (*RunConfig.RUNTIME, "generations", "stop_when_solved")

    population_size: int = 12
    sigma: float = 0.5
    trials: int = 3
    restart_after: int | None = 10
    initial_genotype: tuple[float, ...] = ()
    validation: Validation = field(default_factory=Validation)
    generations: int = 50
    stop_when_solved: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_body()
        counts = {"population_size": (4, MAX_GENOTYPES), "trials": (1, MAX_TRIALS)}
        counts |= {"generations": (0, MAX_GENERATIONS)}
        coerce_integers(self, counts, RunError)
        coerce_floats(self, {"sigma": (MIN_POSITIVE, MAX_SIGMA)}, RunError)
        if self.restart_after is not None:
            coerce_integers(self, {"restart_after": (1, MAX_GENERATIONS)}, RunError)
        self._check_control(self.find_organism(), "give more modules")
        genes = as_floats("initial_genotype", self.initial_genotype, -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
        self._set("initial_genotype", genes)
        if genes and isinstance(self.controller, str):  # one of a user is checked when it is made
            check_genotype("initial_genotype", genes, self.make_controller(self.find_organism()))
