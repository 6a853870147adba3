"""The configuration of a run: what it searches for, and who does the work."""

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from evolution.backends.trials import Randomisation, Scoring
from evolution.controllers.controller import CONTROLLERS
from evolution.errors import RunError
from evolution.limits import (
    LARGEST_SEED,
    MOST_GENERATIONS,
    MOST_GENOTYPES,
    MOST_MODULES,
    MOST_TRIALS,
    MOST_WORKERS,
    SMALLEST_STEP,
    as_counts,
    settle_counts,
    settle_numbers,
)
from evolution.search.environment_options import Options, open_options, sort_options
from evolution.search.evaluation import BACKENDS
from evolution.search.stages import Stage
from evolution.search.validation import Validation
from reconstruction.files.typed_json import JsonError, as_type
from symbrion_gym.environment.config import STARTS

HOW = ("generations", "workers", "backend", "address", "folder", "stop_when_solved")
"""Fields that may change when a run is resumed: they decide how far and by whom, not what comes out."""
_COUNTS = {
    "generations": (0, MOST_GENERATIONS),
    "workers": (1, MOST_WORKERS),
    "population_size": (4, MOST_GENOTYPES),
    "trials": (1, MOST_TRIALS),
    "modules": (2, MOST_MODULES),
    "seed": (0, LARGEST_SEED),
}


@dataclass(frozen=True)
class EvolutionConfig:
    """A run of evolution. Every field is kept in the run folder.

    Attributes:
        arena: name or folder, of a run without stages.
        modules: length of the snake.
        seed: of everything that is drawn.
        generations: at most so many.
        folder: where the run is kept; None keeps it in memory only.
        workers: threads, processes or actors.
        backend: "batch", "processes" or "ray"; the results are equal.
        address: of an existing Ray cluster; None starts a local one.
        controller: "path", "reactive", "travelling", "posture" or "network".
        origin: where the search begins, "zero" (no knowledge) or "hint" (the controller's own, set by hand; then a
            sigma of 0.15 fits better).
        population_size: genotypes a generation; doubles at a restart.
        sigma: first step size.
        trials: of each genotype, under the same conditions within a generation; as many as there are stretches.
        start: where the trials begin, "pit" (close before it) or "floor".
        stages: arenas one after the other, coarse to fine; empty means one stage in `arena`.
        stage_sigma: the step size is raised to this when a stage begins or bodies become shorter, and is this when
            the search begins anew around the fittest genotype.
        body_lengths: shortest and longest body, for an integer gene; None keeps `modules`. Once a body
            holds, the search goes on among shorter ones.
        restart_after: where in so many generations no more trials succeeded than in the best one before, the search
            begins anew: where it began, or, with `body_lengths` or `stages`, around the fittest genotype of the stage,
            since what was learned before is worth keeping. None means never.
        handle_noise: more trials when re-evaluation changes the order of the genotypes.
        stop_when_solved: end when a champion is confirmed.
        randomisation: what the conditions of a trial are drawn from.
        scoring: how an outcome becomes a fitness.
        validation: how candidates for the champion are tried.
        environment: further options of the environment, such as pit or abyss.
    """

    arena: str = "gsrm"
    modules: int = 8
    seed: int = 0
    generations: int = 50
    folder: str | None = None
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    controller: str = "path"
    origin: str = "zero"
    population_size: int = 12
    sigma: float = 0.5
    trials: int = 3
    start: str = "pit"
    stages: tuple[Stage, ...] = ()
    stage_sigma: float = 0.15
    body_lengths: tuple[int, int] | None = None
    restart_after: int | None = 10
    handle_noise: bool = False
    stop_when_solved: bool = True
    randomisation: Randomisation = field(default_factory=Randomisation)
    scoring: Scoring = field(default_factory=Scoring)
    validation: Validation = field(default_factory=Validation)
    environment: Options = ()

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        if isinstance(self.arena, Path):
            set_field(self, "arena", str(self.arena))
        if isinstance(self.folder, Path):
            set_field(self, "folder", str(self.folder))
        if not isinstance(self.arena, str):
            raise RunError(
                f"arena is {type(self.arena).__name__}; a run is kept as text: "
                "save the arena in a folder and name that"
            )
        set_field(self, "stages", tuple(self.stages))
        set_field(self, "environment", sort_options(self.environment))
        self._check()

    def _check(self) -> None:
        settle_counts(self, _COUNTS)
        settle_numbers(self, dict.fromkeys(("sigma", "stage_sigma"), (SMALLEST_STEP, 1000.0)))
        if self.restart_after is not None:
            settle_counts(self, {"restart_after": (1, MOST_GENERATIONS)})
        choices_by_name = {
            "backend": BACKENDS,
            "controller": CONTROLLERS,
            "start": STARTS,
            "origin": ("hint", "zero"),
        }
        for name, choices in choices_by_name.items():
            if getattr(self, name) not in choices:
                raise RunError(f"there is no {name} {getattr(self, name)!r}; there are {', '.join(choices)}")
        if self.body_lengths is not None:
            lengths = as_counts("body_lengths", self.body_lengths, 2, MOST_MODULES)
            object.__setattr__(self, "body_lengths", lengths)
            if len(lengths) != 2 or not lengths[0] < lengths[1]:
                raise RunError(f"body_lengths is {lengths}; shortest < longest, from 2, is needed")

    @property
    def all_stages(self) -> tuple[Stage, ...]:
        """The stages; one that lasts where none were named."""
        return self.stages or (Stage(self.arena),)

    def digest(self) -> str:
        """Return a fingerprint of all that decides what comes out.

        What is None says nothing: a run from before an option existed keeps its fingerprint.
        """
        said = asdict(
            self, dict_factory=lambda pairs: {name: value for name, value in pairs if value is not None}
        )
        content = {name: value for name, value in said.items() if name not in HOW}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def differences(self, other: "EvolutionConfig") -> list[str]:
        """Return "field: this, not that" for all that decides what comes out and differs."""
        names = [each.name for each in fields(self) if each.name not in HOW]
        return [
            f"{name}: {getattr(self, name)!r}, not {getattr(other, name)!r}"
            for name in names
            if getattr(self, name) != getattr(other, name)
        ]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content."""
        return json.loads(json.dumps(asdict(self) | {"environment": dict(self.environment)}))

    @classmethod
    def from_json(cls, content: Any) -> "EvolutionConfig":
        """Return the configuration that `to_json` described.

        Raises:
            RunError: a field is unknown or its value of the wrong kind.
        """
        if isinstance(content, dict):  # a run from before there was the option never begins anew
            content = {"restart_after": None} | content
        try:
            return as_type(open_options(content), cls, "config")
        except JsonError as error:
            raise RunError(str(error)) from error
