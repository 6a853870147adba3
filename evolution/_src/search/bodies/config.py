"""The configuration of a search for bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

from evolution._src.backends.cluster import EXACT_BACKENDS
from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import TrialConfig, take_fields
from evolution._src.backends.trials import Trials
from evolution._src.controllers.finding import refer_to_controller
from evolution._src.controllers.joints import count_tracks
from evolution._src.errors import RunError
from evolution._src.references import (
    MAX_GENERATIONS,
    MAX_GENOTYPES,
    MAX_MODULES,
)
from evolution._src.search.bodies.genome import BodyGenome, make_row
from evolution._src.search.bodies.learning import LearningConfig
from evolution._src.search.bodies.variation import BodyLimits
from evolution._src.search.run_config import RunConfig
from reconstruction._src.base.range_checks import check_choice, coerce_integers
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig

ALGORITHMS = ("surrogate", "random", "exhaustive")


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

    Raises:
        RunError: a value is out of range.
    """

    algorithm: str = "surrogate"
    smallest: int = 1
    largest: int = 8
    dofs: int = 1
    children: int = 9
    population_size: int = 18

    def __post_init__(self) -> None:
        check_choice("algorithm", self.algorithm, ALGORITHMS, RunError)
        limits: dict[str, tuple[float, float]] = dict.fromkeys(
            ("children", "population_size"), (1, MAX_GENOTYPES)
        )
        limits |= dict.fromkeys(("smallest", "largest"), (1, MAX_MODULES))
        limits["dofs"] = (1, 2)
        coerce_integers(self, limits, RunError)
        _ = self.limits

    @property
    def limits(self) -> BodyLimits:
        """How many modules a body has."""
        return BodyLimits(self.smallest, self.largest)

    @property
    def scout(self) -> ScoutConfig:
        """Constants of the modules."""
        return ScoutConfig(dofs=self.dofs)


@dataclass(frozen=True, kw_only=True)
class BodyEvolutionConfig(RunConfig):
    """A search for bodies, each of which learns its controller. The run folder stores every field.

    What is no field is an option of the environment, such as `pit` or `track_control`.

    Attributes:
        scoring: how an outcome becomes a fitness; by default without a penalty for modules.
        bodies: which bodies are searched, and how.
        learning: how much a body may learn.
        iterations: largest number of iterations of the algorithm.

    Raises:
        RunError: a value is out of range, or fields do not fit together; with the value and what is allowed.
    """

    RUNTIME: ClassVar[tuple[str, ...]] = (*RunConfig.RUNTIME, "iterations")
    POSSIBLE_BACKENDS: ClassVar[tuple[str, ...]] = EXACT_BACKENDS

    controller: Any = "oscillators"
    scoring: Any = field(default_factory=partial(Scoring, module=0.0))
    bodies: BodiesConfig = field(default_factory=BodiesConfig)
    learning: LearningConfig = field(default_factory=LearningConfig)
    iterations: int = 20

    def __post_init__(self) -> None:
        for name in set(dict(self.environment)) & {"modules", "organism"}:
            raise RunError(
                f"{name} is given, and bodies are searched; leave it out, or use `EvolutionConfig`"
            )
        super().__post_init__()
        coerce_integers(self, {"iterations": (0, MAX_GENERATIONS)}, RunError)
        organism = self.make_organism(self.make_shortest())
        tracks = count_tracks(self.track_control, organism.num_modules)
        if not (organism.hinges or tracks):
            raise RunError(
                "bodies of 1 module have no hinge; begin at smallest=2, or drive the tracks, for example by "
                "track_control='skid'"
            )
        controller = refer_to_controller(
            self.controller, organism, tracks, must_be_found=self.must_be_restorable
        )
        self._set("controller", controller)

    def make_shortest(self) -> BodyGenome:
        """Return a row of as few modules as are searched."""
        return make_row(self.bodies.smallest)

    def make_organism(self, body: BodyGenome) -> Organism:
        """Return a body of the modules of this search."""
        return body.to_organism(self.bodies.scout)

    def make_trials(self, body: BodyGenome, count: int, seed: tuple[int, ...]) -> Trials:
        """Return the trials of genotypes of a body."""
        return Trials(
            **take_fields(self, TrialConfig),
            organism=self.make_organism(body),
            count=count,
            seed=(self.seed, *seed),
        )
