"""The configuration of a run: what it searches for, and on which workers."""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

from evolution._src.backends.cluster import BACKENDS, LOCAL_BACKENDS
from evolution._src.backends.nested import Nested
from evolution._src.backends.parts import (
    BodyConfig,
    ControlConfig,
    EpisodeConfig,
    check_body_options,
    take_environment,
)
from evolution._src.backends.scoring import Scoring, find_scoring
from evolution._src.backends.trials import TrialConfig
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
    SHARED_KINDS,
    Kinds,
    drop_none,
    read_content,
    restore,
    to_json,
    to_text,
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


@dataclass(frozen=True)
class SearchConfig:
    """The search for a genotype: CMA-ES, and when it restarts.

    Attributes:
        population_size: number of genotypes per generation; doubles each time CMA-ES has converged and restarts, but
            not at the restarts of `restart_after`.
        sigma: initial step size of CMA-ES.
        trials: number of trials of each genotype, under the same conditions within a generation; by default as many
            as `Randomization` has stretches of the arena.
        restart_after: number of generations without more successful trials than in the best generation before, after
            which the search restarts where it began. None means never.
        initial_genotype: genes at which the search begins, such as those of a champion; empty: as `origin` says.
    """

    population_size: int = 12
    sigma: float = 0.5
    trials: int = 3
    restart_after: int | None = 10
    initial_genotype: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        limits = {"population_size": (4, MAX_GENOTYPES), "trials": (1, MAX_TRIALS)}
        coerce_integers(self, limits, RunError)
        coerce_floats(self, {"sigma": (MIN_POSITIVE, _MAX_SIGMA)}, RunError)
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


RUNTIME_FIELDS = ("generations", "workers", "backend", "address", "folder", "stop_when_solved")
"""Fields that may change when a run is resumed: they decide its length and where it runs, not its results."""
KINDS: Kinds = SHARED_KINDS | {
    "arena": str,
    "seed": int,
    "scoring": Scoring,
    "population_size": int,
    "sigma": float,
    "trials": int,
    "restart_after": int | None,
    "initial_genotype": tuple[float, ...],
    "validation": Validation,
    "generations": int,
    "workers": int,
    "backend": str,
    "address": str | None,
    "folder": str | None,
    "stop_when_solved": bool,
}
"""Types of the fields in a file."""


@dataclass(frozen=True, init=False)
class EvolutionConfig(Nested):
    """A run of evolution. The run folder stores every field.

    The fields of its parts count as its own: `EvolutionConfig(modules=5, generations=30)` is the same as
    `EvolutionConfig(body=BodyConfig(modules=5), execution=ExecutionConfig(generations=30))`. What is no field is an
    option of the environment, such as `pit` or `track_control`.

    Attributes:
        arena: name, folder or file of the arena.
        seed: seed of all random numbers of the run.
        body: the body: `modules`, `organism`.
        episode: what is to be done: `task`, `start`, `goal`, `environment`.
        control: the controller and where the search begins: `controller`, `controller_config`, `origin`.
        trial: how trials vary and are simulated: `randomization`, `rollout`.
        scoring: how an outcome becomes a fitness: the weights of a `Scoring`, a function of (outcome, body), or
            "module:name" of one.
        search: the search: `population_size`, `sigma`, `trials`, `restart_after` and others.
        validation: rules by which candidates for the champion are validated.
        execution: length and place of the run: `generations`, `workers`, `backend`, `folder` and others.

    Raises:
        RunError: a value is out of range, or parts do not fit together; with the value and what is allowed.
    """

    PARTS: ClassVar[tuple[str, ...]] = ("body", "episode", "control", "trial", "search", "execution")

    arena: str = "gsrm"
    seed: int = 0
    body: BodyConfig = field(default_factory=BodyConfig)
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)
    control: ControlConfig = field(default_factory=ControlConfig)
    trial: TrialConfig = field(default_factory=TrialConfig)
    scoring: Any = field(default_factory=Scoring)
    search: SearchConfig = field(default_factory=SearchConfig)
    validation: Validation = field(default_factory=Validation)
    execution: ExecutionConfig = field(default_factory=ExecutionConfig)

    def check_given(self, values: Mapping[str, Any]) -> None:
        """Refuse two bodies."""
        check_body_options(values)

    def take_others(self, others: dict[str, Any]) -> None:
        """Take further options of the environment."""
        take_environment(self, others)

    def __post_init__(self) -> None:
        if isinstance(self.arena, PathLike):
            self.set_field("arena", str(Path(self.arena)))
        if not isinstance(self.arena, str):
            raise RunError(
                f"arena is {type(self.arena).__name__}; a run is stored as text: "
                "save the arena in a folder and name that"
            )
        if not isinstance(self.body, BodyConfig):
            raise RunError(
                f"body is {type(self.body).__name__}; a `BodyConfig` is needed. To search for bodies, give `evolve` a "
                "BodyEvolutionConfig(bodies=BodiesConfig(...))"
            )
        self.set_field("scoring", find_scoring(self.scoring))
        coerce_integers(self, {"seed": (0, MAX_SEED)}, RunError)
        self._check_control()

    def _check_control(self) -> None:
        organism = self.body.find_organism()
        num_tracks = count_tracks(self.episode.track_control, organism.num_modules)
        controller = refer_to_controller(
            self.controller, organism, num_tracks, must_be_found=self.must_be_restorable
        )
        self.set_field("controller", controller)
        if not (organism.hinges or num_tracks):
            raise RunError(
                f"the body has {format_count(organism.num_modules, 'module')} and no hinge; give more modules, or "
                "drive the tracks, "
                "for example by track_control='skid'"
            )
        self._check_initial_genotype()

    def _check_initial_genotype(self) -> None:
        if not self.initial_genotype:
            return
        if isinstance(self.controller, str):  # one of a user is imported when it is made, and checked then
            law = self.control.make_controller(self.body.find_organism(), self.episode)
            check_genotype("initial_genotype", self.initial_genotype, law)

    @property
    def must_be_restorable(self) -> bool:
        """Whether a file or other processes must find again what a user wrote."""
        return self.execution.folder is not None or self.execution.backend not in LOCAL_BACKENDS

    @property
    def validation_start(self) -> Any:
        """Start of validation trials: as the rules say, unless the run has a place of its own."""
        start = self.episode.find_start()
        return self.validation.start if isinstance(start, str) else start

    def digest(self) -> str:
        """Return a fingerprint of all that decides the results of a run."""
        content = to_json(self, KINDS) | {"start": self.episode.find_start()}
        content = {name: value for name, value in content.items() if name not in RUNTIME_FIELDS}
        content = drop_none(list(content.items()))
        return hashlib.sha256(to_text(content, is_sorted=True).encode()).hexdigest()

    def differences(self, other: "EvolutionConfig") -> list[str]:
        """Return "field: this, not that" for each difference that decides the results of a run."""
        mine, theirs = self.flatten(), other.flatten()
        return [
            f"{name}: {value!r}, not {theirs[name]!r}"
            for name, value in mine.items()
            if name not in RUNTIME_FIELDS and value != theirs[name]
        ]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content, with the fields of parts as its own.

        Raises:
            RunError: a part is an object of a user that nothing would restore.
        """
        content = to_json(self, KINDS)
        return json.loads(to_text(content | {"environment": dict(content["environment"])}))

    @classmethod
    def from_json(cls, content: object) -> "EvolutionConfig":
        """Return the configuration described by `to_json`; this imports nothing.

        Raises:
            RunError: a field is unknown or its value of the wrong kind.
        """
        return cls(**read_content(content, KINDS, "config"))

    def restore(self, allow: Collection[str] = ()) -> "EvolutionConfig":
        """Return the configuration with what a user wrote imported again.

        Raises:
            RunError: something cannot be imported, or has changed since the run began.
        """
        return restore(self, allow)
