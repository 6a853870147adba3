"""The configuration of a search for bodies."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

from evolution._src.backends.cluster import EXACT_BACKENDS
from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import TrialConfig, take_fields
from evolution._src.backends.trials import Trials
from evolution._src.errors import RunError
from evolution._src.references import MAX_GENERATIONS, MAX_GENOTYPES, MAX_MODULES, MAX_TRIALS, MIN_POSITIVE
from evolution._src.search.bodies.genome import BodyGenome, make_row
from evolution._src.search.config import MAX_SIGMA, RunConfig
from reconstruction._src.base.range_checks import check_choice, coerce_floats, coerce_integers
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig

ALGORITHMS = ("surrogate", "random", "exhaustive")
_MAX_LEVELS = 10


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
        limits = dict.fromkeys(("children", "population_size"), (1, MAX_GENOTYPES))
        limits |= {"smallest": (1, MAX_MODULES), "largest": (1, MAX_MODULES), "dofs": (1, 2)}
        coerce_integers(self, limits, RunError)
        if self.smallest > self.largest:
            raise RunError(
                f"bodies need 1 <= smallest <= largest modules, got {self.smallest} and {self.largest}"
            )

    @property
    def limits(self) -> tuple[int, int]:
        """Smallest and largest number of modules."""
        return self.smallest, self.largest


@dataclass(frozen=True)
class LearningConfig:
    """How much a body may learn, and what counts as its fitness.

    Attributes:
        population_size: genotypes of a generation of CMA-ES.
        levels: generations that a body has learned in all at the end of each level, the start included.
        sigma: initial step size of CMA-ES, relative to the hint or the zero genotype.
        trials: trials of each genotype.
        exam_trials: trials of the best genotype at the end of a level, under conditions that are not those of learning;
            their fitness is that of the body. The best of many noisy samples would flatter it.
        is_examined_early: whether there is an exam at the end of each level; else at the end of the last alone, and
            the best fitness of learning counts before: flattering, alike for the bodies of a level, and cheap.

    Raises:
        RunError: a value is out of range, or the levels do not rise.
    """

    population_size: int = 8
    levels: tuple[int, ...] = (2, 6, 18)
    sigma: float = 0.5
    trials: int = 1
    exam_trials: int = 4
    is_examined_early: bool = True

    def __post_init__(self) -> None:
        limits = dict.fromkeys(("trials", "exam_trials"), (1, MAX_TRIALS))
        coerce_integers(self, limits | {"population_size": (4, MAX_GENOTYPES)}, RunError)
        coerce_floats(self, {"sigma": (MIN_POSITIVE, MAX_SIGMA)}, RunError)
        levels = tuple(int(level) for level in self.levels)
        object.__setattr__(self, "levels", levels)
        rises = all(low < high for low, high in zip((0, *levels), levels, strict=False))
        if not 1 <= len(levels) <= _MAX_LEVELS or not rises or levels[-1] > MAX_GENERATIONS:
            raise RunError(
                f"levels is {self.levels}; 1 to {_MAX_LEVELS} rising numbers are needed, such as (2, 6, 18)"
            )

    @property
    def last(self) -> int:
        """Index of the last level."""
        return len(self.levels) - 1

    def has_exam(self, level: int) -> bool:
        """Return whether a level ends with an exam."""
        return self.is_examined_early or level == self.last

    def count_trials(self, level: int) -> int:
        """Return the trials of a body in a level, those of the levels before left out."""
        begin, end = ((0, *self.levels)[level + each] for each in (0, 1))
        genotypes = self.population_size * (end - begin)
        if not begin:
            genotypes += 1 - self.population_size  # the first generation is the start alone
        return genotypes * self.trials + self.has_exam(level) * self.exam_trials


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
    STEP: ClassVar[str] = "iteration"

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
        self._check_control(self.make_organism(make_row(self.bodies.smallest)), "begin at 2 modules")

    def make_organism(self, body: BodyGenome) -> Organism:
        """Return a body of the modules of this search."""
        return body.to_organism(ScoutConfig(dofs=self.bodies.dofs))

    def make_trials(self, body: BodyGenome, count: int, seed: tuple[int, ...]) -> Trials:
        """Return the trials of genotypes of a body."""
        settings = take_fields(self, TrialConfig)
        return Trials(**settings, organism=self.make_organism(body), count=count, seed=(self.seed, *seed))
