"""The configuration of a run: what it searches for, and on which workers."""

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from evolution.backends.trials import Options, Randomization, RolloutConfig, Scoring
from evolution.controllers.controller import ControllerConfig
from evolution.controllers.drive import count_tracks
from evolution.controllers.finding import controller_to_json, refer_to_controller
from evolution.errors import RunError
from evolution.limits import (
    MAX_GENERATIONS,
    MAX_GENOTYPES,
    MAX_MODULES,
    MAX_SEED,
    MAX_TRIALS,
    MAX_WORKERS,
    MIN_POSITIVE,
)
from evolution.search.cmaes import CmaesConfig
from evolution.search.environment_options import open_options, sort_options
from evolution.search.evaluation import BACKENDS
from evolution.search.stages import Stage
from evolution.search.validation import FORMER_VALIDATION_NAMES, Validation
from reconstruction.deprecation import accept_former_fields, rename_keys
from reconstruction.files.typed_json import JsonError, as_type
from reconstruction.range_checks import as_integers, check_choice, coerce_floats, coerce_integers
from symbrion_gym.environment.config import STARTS
from symbrion_gym.robot.organism import snake

RUNTIME_FIELDS = ("generations", "workers", "backend", "address", "folder", "stop_when_solved")
"""Fields that may change when a run is resumed: they decide its length and where it runs, not its results."""
ORIGINS = ("hint", "zero")
"""Where a search may begin."""
FORMER_NAMES = {"randomisation": "randomization"}
"""Former name -> present name of fields of `EvolutionConfig`."""
_NAMES_IN_DIGEST = {present: former for former, present in (FORMER_NAMES | FORMER_VALIDATION_NAMES).items()}
"""A digest is computed with the former names, so that runs of earlier versions keep theirs."""
_ADDED = {
    "cmaes": asdict(CmaesConfig()),
    "success_threshold": Validation.success_threshold,
    "controller_config": asdict(ControllerConfig()),
    "rollout": asdict(RolloutConfig()),
}
"""Fields that earlier versions lacked, and what these did instead: with this value they are left out of a digest."""
_MAX_SIGMA = 1000.0
_INTEGERS = {
    "generations": (0, MAX_GENERATIONS),
    "workers": (1, MAX_WORKERS),
    "population_size": (4, MAX_GENOTYPES),
    "trials": (1, MAX_TRIALS),
    "modules": (2, MAX_MODULES),
    "seed": (0, MAX_SEED),
}


@accept_former_fields(**FORMER_NAMES)
@dataclass(frozen=True)
class EvolutionConfig:
    """A run of evolution. The run folder stores every field.

    Attributes:
        arena: name or folder of the arena of a run without stages.
        modules: number of modules of the snake.
        seed: seed of all random numbers of the run.
        generations: largest number of generations.
        folder: run folder; None keeps the run in memory only.
        workers: number of threads, processes or actors.
        backend: "batch", "processes" or "ray"; the results are equal.
        address: address of an existing Ray cluster; None starts a local one.
        controller: name of a law of ours ("path", "reactive", "travelling", "posture" or "network"), or a controller of
            a user: an object, a class or function of the organism, or "module:name"; see `find_controller`.
        origin: genotype at which the search begins, "zero" (no knowledge) or "hint" (set by hand for the controller;
            then a sigma of 0.15 fits better).
        population_size: number of genotypes per generation; doubles each time CMA-ES has converged and restarts, but
            not at the restarts of `restart_after`.
        sigma: initial step size of CMA-ES.
        trials: number of trials of each genotype, under the same conditions within a generation; by default as many
            as `Randomization` has stretches of the arena.
        start: start of the trials, "pit" (close before the pit) or "floor".
        stages: arenas one after the other, coarse to fine; empty means one stage in `arena`.
        stage_sigma: the step size is raised to this when a stage begins or bodies become shorter, and set to this
            when the search restarts around the fittest genotype.
        body_lengths: smallest and largest number of modules, if evolution selects it by an additional integer gene;
            None keeps `modules`. Once a body succeeds reliably, the search continues with shorter ones.
        restart_after: number of generations without more successful trials than in the best generation before, after
            which the search restarts: where it began, or, with `body_lengths` or `stages`, around the fittest genotype
            of the stage, to keep what was learned before. None means never.
        handle_noise: whether the number of trials rises when re-evaluation changes the order of the genotypes.
        stop_when_solved: whether the run ends when a champion is confirmed.
        randomization: ranges from which the conditions of the trials are sampled.
        scoring: weights with which an outcome becomes a fitness.
        validation: rules by which candidates for the champion are validated.
        environment: further options of the environment, such as pit, goal or bottomless.
        cmaes: restarts of CMA-ES after convergence, and limits of noise handling.
        controller_config: parameters of the controller that are not evolved.
        rollout: parameters of the simulation of trials.
    """

    arena: str = "gsrm"
    modules: int = 8
    seed: int = 0
    generations: int = 50
    folder: str | None = None
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    controller: Any = "path"
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
    randomization: Randomization = field(default_factory=Randomization)
    scoring: Scoring = field(default_factory=Scoring)
    validation: Validation = field(default_factory=Validation)
    environment: Options = ()
    cmaes: CmaesConfig = field(default_factory=CmaesConfig)
    controller_config: ControllerConfig = field(default_factory=ControllerConfig)
    rollout: RolloutConfig = field(default_factory=RolloutConfig)

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        if isinstance(self.arena, Path):
            set_field(self, "arena", str(self.arena))
        if isinstance(self.folder, Path):
            set_field(self, "folder", str(self.folder))
        if not isinstance(self.arena, str):
            raise RunError(
                f"arena is {type(self.arena).__name__}; a run is stored as text: "
                "save the arena in a folder and name that"
            )
        set_field(self, "stages", tuple(self.stages))
        set_field(self, "environment", sort_options(self.environment))
        self._check()

    def _check(self) -> None:
        coerce_integers(self, _INTEGERS, RunError)
        coerce_floats(self, dict.fromkeys(("sigma", "stage_sigma"), (MIN_POSITIVE, _MAX_SIGMA)), RunError)
        if self.restart_after is not None:
            coerce_integers(self, {"restart_after": (1, MAX_GENERATIONS)}, RunError)
        check_choice("backend", self.backend, BACKENDS, RunError)
        check_choice("start", self.start, STARTS, RunError)
        check_choice("origin", self.origin, ORIGINS, RunError)
        if self.body_lengths is not None:
            lengths = as_integers("body_lengths", self.body_lengths, 2, MAX_MODULES, RunError)
            object.__setattr__(self, "body_lengths", lengths)
            if len(lengths) != 2 or not lengths[0] < lengths[1]:
                raise RunError(f"body_lengths is {lengths}; shortest < longest, from 2, is needed")
        organism = snake(self.body_lengths[1] if self.body_lengths else self.modules)
        num_tracks = count_tracks(
            dict(self.environment).get("track_control", "constant"), organism.num_modules
        )
        must_be_found = self.folder is not None or self.backend != "batch"
        controller = refer_to_controller(self.controller, organism, num_tracks, must_be_found=must_be_found)
        object.__setattr__(self, "controller", controller)

    @property
    def all_stages(self) -> tuple[Stage, ...]:
        """The stages; a single one where none are given."""
        return self.stages or (Stage(self.arena),)

    def digest(self) -> str:
        """Return a fingerprint of all that decides the results of a run.

        Options that are None are left out: a run from before an option existed keeps its fingerprint.
        """
        content = asdict(self, dict_factory=_collect_for_digest)
        content = {name: value for name, value in content.items() if name not in RUNTIME_FIELDS}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def differences(self, other: "EvolutionConfig") -> list[str]:
        """Return "field: this, not that" for each difference that decides the results of a run."""
        names = [each.name for each in fields(self) if each.name not in RUNTIME_FIELDS]
        return [
            f"{name}: {getattr(self, name)!r}, not {getattr(other, name)!r}"
            for name in names
            if getattr(self, name) != getattr(other, name)
        ]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content."""
        controller = controller_to_json(self.controller)
        return json.loads(
            json.dumps(asdict(self) | {"environment": dict(self.environment), "controller": controller})
        )

    @classmethod
    def from_json(cls, content: object) -> "EvolutionConfig":
        """Return the configuration described by `to_json`, also of an earlier version.

        Raises:
            RunError: a field is unknown or its value of the wrong kind.
        """
        content = rename_keys(content, FORMER_NAMES)
        if isinstance(content, dict):  # a run from before this option existed never restarts
            content = {"restart_after": None} | content
            if "validation" in content:
                content["validation"] = rename_keys(content["validation"], FORMER_VALIDATION_NAMES)
        try:
            return as_type(open_options(content), cls, "config")
        except JsonError as error:
            raise RunError(str(error)) from error


def _collect_for_digest(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    return {
        _NAMES_IN_DIGEST.get(name, name): value
        for name, value in pairs
        if value is not None and not (name in _ADDED and value == _ADDED[name])
    }
