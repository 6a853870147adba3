"""The configuration of a search for bodies."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

from evolution._src.backends.cluster import EXACT_BACKENDS
from evolution._src.backends.nested import Nested
from evolution._src.backends.parts import BodyConfig, ControlConfig, EpisodeConfig, take_environment
from evolution._src.backends.scoring import Scoring, find_scoring
from evolution._src.backends.trials import TrialConfig, Trials
from evolution._src.bodies.genome import BodyGenome, make_row
from evolution._src.bodies.variation import BodyLimits
from evolution._src.body_search.learning import LearningConfig
from evolution._src.controllers.finding import refer_to_controller
from evolution._src.controllers.joints import count_tracks
from evolution._src.errors import RunError
from evolution._src.references import (
    MAX_GENERATIONS,
    MAX_GENOTYPES,
    MAX_MAGNITUDE,
    MAX_MODULES,
    MAX_SEED,
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
from reconstruction._src.base.range_checks import check_choice, coerce_floats, coerce_integers
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig

ALGORITHMS = ("surrogate", "random", "exhaustive")
RUNTIME_FIELDS = ("iterations", "max_seconds", "workers", "backend", "address", "folder")
"""Fields that may change when a run is resumed: they decide its length and where it runs, not its results."""
_BODY_FIELDS = ("modules", "organism")


@dataclass(frozen=True)
class BodiesConfig:
    """Which bodies are searched, and how.

    Attributes:
        algorithm: "surrogate" (bodies learn in budget levels, and a prediction from their shapes chooses who learns),
            "random" or "exhaustive" (all bodies, the small ones first).
        smallest: smallest number of modules.
        largest: largest number of modules.
        dofs: rotational degrees of freedom of each module: 1 (the hinge), or 2 (and the rotation of the arm, which
            `oscillators` moves by genes of its own).
        children: new bodies of an iteration.
        population_size: bodies of the first iteration, and fittest ones that may become parents.
        max_seconds: simulated time after which no new iteration begins [s]; None: `iterations` decide alone. A resumed
            run may have another one.

    Raises:
        RunError: a value is out of range.
    """

    algorithm: str = "surrogate"
    smallest: int = 1
    largest: int = 8
    dofs: int = 1
    children: int = 9
    population_size: int = 18
    max_seconds: float | None = None

    def __post_init__(self) -> None:
        check_choice("algorithm", self.algorithm, ALGORITHMS, RunError)
        limits: dict[str, tuple[float, float]] = dict.fromkeys(
            ("children", "population_size"), (1, MAX_GENOTYPES)
        )
        limits |= dict.fromkeys(("smallest", "largest"), (1, MAX_MODULES))
        limits["dofs"] = (1, 2)
        coerce_integers(self, limits, RunError)
        if self.max_seconds is not None:
            coerce_floats(self, {"max_seconds": (MIN_POSITIVE, MAX_MAGNITUDE)}, RunError)
        _ = self.limits

    @property
    def limits(self) -> BodyLimits:
        """How many modules a body has."""
        return BodyLimits(self.smallest, self.largest)

    @property
    def scout(self) -> ScoutConfig:
        """Constants of the modules."""
        return ScoutConfig(dofs=self.dofs)


@dataclass(frozen=True)
class BodyExecutionConfig:
    """How long a search for bodies lasts, where it runs and where it is kept; nothing here changes its results.

    Attributes:
        iterations: largest number of iterations of the algorithm.
        workers: number of threads, processes or actors.
        backend: "batch" (threads), "processes" or "ray"; the results are equal.
        address: address of an existing Ray cluster; None starts a local one.
        folder: run folder; None keeps the run in memory only.
    """

    iterations: int = 20
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    folder: str | None = None

    def __post_init__(self) -> None:
        if isinstance(self.folder, Path):
            object.__setattr__(self, "folder", str(self.folder))
        coerce_integers(self, {"iterations": (0, MAX_GENERATIONS), "workers": (1, MAX_WORKERS)}, RunError)
        check_choice("backend", self.backend, EXACT_BACKENDS, RunError)


KINDS: Kinds = {name: kind for name, kind in SHARED_KINDS.items() if name not in _BODY_FIELDS} | {
    "arena": str,
    "seed": int,
    "scoring": Scoring,
    "algorithm": str,
    "smallest": int,
    "largest": int,
    "dofs": int,
    "children": int,
    "population_size": int,
    "max_seconds": float | None,
    "learning": LearningConfig,
    "iterations": int,
    "workers": int,
    "backend": str,
    "address": str | None,
    "folder": str | None,
}
"""Types of the fields in a file."""


@dataclass(frozen=True, init=False)
class BodyEvolutionConfig(Nested):
    """A search for bodies, each of which learns its controller. The run folder stores every field.

    The fields of the parts `episode`, `control`, `trial`, `bodies` and `execution` count as its own; those of
    `learning` do not. What is no field is an option of the environment, such as `pit` or `track_control`.

    Attributes:
        arena: name, folder or file of the arena.
        seed: seed of all random numbers of the run.
        episode: what is to be done: `task`, `start`, `goal`, `environment`.
        control: the controller and where learning begins: `controller`, `controller_config`, `origin`.
        trial: how trials vary and are simulated: `randomization`, `rollout`.
        scoring: how an outcome becomes a fitness; by default without a penalty for modules.
        bodies: which bodies are searched, and how: `algorithm`, `smallest`, `largest` and others.
        learning: how much a body may learn.
        execution: length and place of the run: `iterations`, `workers`, `folder` and
            others.

    Raises:
        RunError: a value is out of range, or parts do not fit together; with the value and what is allowed.
    """

    PARTS: ClassVar[tuple[str, ...]] = ("episode", "control", "trial", "bodies", "execution")

    arena: str = "gsrm"
    seed: int = 0
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)
    control: ControlConfig = field(default_factory=partial(ControlConfig, controller="oscillators"))
    trial: TrialConfig = field(default_factory=TrialConfig)
    scoring: Any = field(default_factory=partial(Scoring, module=0.0))
    bodies: BodiesConfig = field(default_factory=BodiesConfig)
    learning: LearningConfig = field(default_factory=LearningConfig)
    execution: BodyExecutionConfig = field(default_factory=BodyExecutionConfig)

    def take_others(self, others: dict[str, Any]) -> None:
        """Take further options of the environment."""
        refused = [name for name in others if name in _BODY_FIELDS]
        if refused:
            raise RunError(
                f"{refused[0]} is given, and bodies are searched; leave it out, or use `EvolutionConfig`"
            )
        take_environment(self, others)

    def __post_init__(self) -> None:
        if isinstance(self.arena, PathLike):
            self.set_field("arena", str(Path(self.arena)))
        if not isinstance(self.arena, str):
            raise RunError(
                f"arena is {type(self.arena).__name__}; a run is stored as text: "
                "save the arena in a folder and name that"
            )
        self.set_field("scoring", find_scoring(self.scoring))
        coerce_integers(self, {"seed": (0, MAX_SEED)}, RunError)
        organism = self.make_organism(self.make_shortest())
        tracks = count_tracks(self.episode.track_control, organism.num_modules)
        if not (organism.hinges or tracks):
            raise RunError(
                "bodies of 1 module have no hinge; begin at smallest=2, or drive the tracks, for example by "
                "track_control='skid'"
            )
        must_be_found = self.execution.folder is not None or self.execution.backend != "batch"
        controller = refer_to_controller(self.controller, organism, tracks, must_be_found=must_be_found)
        self.set_field("controller", controller)

    def make_shortest(self) -> BodyGenome:
        """Return a row of as few modules as are searched."""
        return make_row(self.bodies.smallest)

    def make_organism(self, body: BodyGenome) -> Organism:
        """Return a body of the modules of this search."""
        return body.to_organism(self.bodies.scout)

    def make_trials(self, body: BodyGenome, count: int, seed: tuple[int, ...]) -> Trials:
        """Return the trials of genotypes of a body."""
        return Trials(
            arena=self.arena,
            body=BodyConfig(organism=self.make_organism(body)),
            episode=self.episode,
            control=self.control,
            trial=self.trial,
            count=count,
            seed=(self.seed, *seed),
        )

    def digest(self) -> str:
        """Return a fingerprint of all that decides the results of a run."""
        content = {name: value for name, value in self.to_json().items() if name not in RUNTIME_FIELDS}
        content = drop_none(list(content.items()))
        return hashlib.sha256(to_text(content, is_sorted=True).encode()).hexdigest()

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content, with the fields of parts as its own.

        Raises:
            RunError: a part is an object of a user that nothing would restore.
        """
        content = to_json(self, KINDS)
        return content | {"environment": dict(content["environment"])}

    @classmethod
    def from_json(cls, content: object) -> BodyEvolutionConfig:
        """Return the configuration described by `to_json`; this imports nothing.

        Raises:
            RunError: a field is unknown or its value of the wrong kind.
        """
        return cls(**read_content(content, KINDS, "config"))

    def restore(self, allow: Collection[str] = ()) -> BodyEvolutionConfig:
        """Return the configuration with what a user wrote imported again.

        Raises:
            RunError: it is not there, or of another version.
        """
        return restore(self, allow)
