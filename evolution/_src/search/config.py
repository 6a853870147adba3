"""The configuration of a run: what it searches for, and on which workers."""

from collections.abc import Collection
from dataclasses import dataclass, field, fields
from typing import Any

from evolution._src.backends.cluster import BACKENDS, LOCAL_BACKENDS
from evolution._src.backends.scoring import Scoring, find_scoring
from evolution._src.backends.settings import BodyConfig, TrialConfig
from evolution._src.controllers.finding import check_genotype, refer_to_controller
from evolution._src.controllers.joints import count_tracks
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
from evolution._src.search.stored_config import (
    check_text_fields,
    compute_digest,
    read_content,
    restore,
    to_json,
)
from evolution._src.search.validation import Validation
from reconstruction._src.base.range_checks import (
    as_floats,
    check_choice,
    coerce_floats,
    coerce_integers,
    format_count,
)

_MAX_SIGMA = 1000.0
RUNTIME_FIELDS = ("generations", "workers", "backend", "address", "folder", "stop_when_solved")
"""Fields that may change when a run is resumed: they decide its length and where it runs, not its results."""


@dataclass(frozen=True, kw_only=True)
class EvolutionConfig(TrialConfig, BodyConfig):
    """A run of evolution: an episode, a body, the search for a genotype by CMA-ES, and where it runs.

    The run folder stores every field. What is no field is an option of the environment, such as `pit` or
    `track_control`. Only the backend "warp" changes results; length, workers and folder do not.

    Attributes:
        seed: seed of all random numbers of the run.
        scoring: how an outcome becomes a fitness: the weights of a `Scoring`, a function of (outcome, body), or
            "module:name" of one.
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
        workers: number of threads, processes or actors.
        backend: "batch" (threads), "processes" or "ray"; the results are equal. "warp" tries the samples of a
            generation on a GPU in single precision, with results that are equal in distribution only; candidates for
            the champion are tried on threads by MuJoCo's C engine as always.
        address: address of an existing Ray cluster; None starts a local one.
        folder: run folder; None keeps the run in memory only.
        stop_when_solved: whether the run ends when a champion is confirmed.

    Raises:
        RunError: a value is out of range, or fields do not fit together; with the value and what is allowed.
    """

    seed: int = 0
    scoring: Any = field(default_factory=Scoring)
    population_size: int = 12
    sigma: float = 0.5
    trials: int = 3
    restart_after: int | None = 10
    initial_genotype: tuple[float, ...] = ()
    validation: Validation = field(default_factory=Validation)
    generations: int = 50
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    folder: str | None = None
    stop_when_solved: bool = True

    def __post_init__(self) -> None:
        check_text_fields(self)
        super().__post_init__()
        self.check_body()
        self._set("scoring", find_scoring(self.scoring))
        counts = {"population_size": (4, MAX_GENOTYPES), "trials": (1, MAX_TRIALS), "seed": (0, MAX_SEED)}
        counts |= {"generations": (0, MAX_GENERATIONS), "workers": (1, MAX_WORKERS)}
        coerce_integers(self, counts, RunError)
        coerce_floats(self, {"sigma": (MIN_POSITIVE, _MAX_SIGMA)}, RunError)
        if self.restart_after is not None:
            coerce_integers(self, {"restart_after": (1, MAX_GENERATIONS)}, RunError)
        check_choice("backend", self.backend, BACKENDS, RunError)
        self._check_control()

    def _check_control(self) -> None:
        organism = self.find_organism()
        num_tracks = count_tracks(self.track_control, organism.num_modules)
        controller = refer_to_controller(
            self.controller, organism, num_tracks, must_be_found=self.must_be_restorable
        )
        self._set("controller", controller)
        if not (organism.hinges or num_tracks):
            raise RunError(
                f"the body has {format_count(organism.num_modules, 'module')} and no hinge; give more modules, or "
                "drive the tracks, for example by track_control='skid'"
            )
        genes = as_floats("initial_genotype", self.initial_genotype, -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
        self._set("initial_genotype", genes)
        if genes and isinstance(
            controller, str
        ):  # one of a user is imported when it is made, and checked then
            check_genotype("initial_genotype", genes, self.make_controller(organism))

    @property
    def must_be_restorable(self) -> bool:
        """Whether a file or other processes must find again what a user wrote."""
        return self.folder is not None or self.backend not in LOCAL_BACKENDS

    @property
    def validation_start(self) -> Any:
        """Start of validation trials: as the rules say, unless the run has a place of its own."""
        start = self.find_start()
        return self.validation.start if isinstance(start, str) else start

    def differences(self, other: "EvolutionConfig") -> list[str]:
        """Return "field: this, not that" for each difference that decides the results of a run."""
        return [
            f"{each.name}: {getattr(self, each.name)!r}, not {getattr(other, each.name)!r}"
            for each in fields(self)
            if each.name not in RUNTIME_FIELDS and getattr(self, each.name) != getattr(other, each.name)
        ]

    def digest(self) -> str:
        """Return a fingerprint of all that decides the results of a run."""
        return compute_digest(self, RUNTIME_FIELDS)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content.

        Raises:
            RunError: a part is an object of a user that nothing would restore.
        """
        return to_json(self)

    @classmethod
    def from_json(cls, content: object) -> "EvolutionConfig":
        """Return the configuration described by `to_json`; this imports nothing.

        Raises:
            RunError: a field is unknown or its value of the wrong kind.
        """
        return cls(**read_content(content, cls, "config"))

    def restore(self, allow: Collection[str] = ()) -> "EvolutionConfig":
        """Return the configuration with what a user wrote imported again.

        Raises:
            RunError: something cannot be imported, or has changed since the run began.
        """
        return restore(self, allow)
