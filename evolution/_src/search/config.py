"""The configuration of a run: what it searches for, and on which workers."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

from evolution._src.backends.settings import BodyConfig
from evolution._src.controllers.finding import check_genotype, refer_to_controller
from evolution._src.controllers.joints import count_tracks
from evolution._src.errors import RunError
from evolution._src.references import (
    MAX_GENERATIONS,
    MAX_GENOTYPES,
    MAX_MAGNITUDE,
    MAX_TRIALS,
    MIN_POSITIVE,
)
from evolution._src.search.run_config import RunConfig
from evolution._src.search.validation import Validation
from reconstruction._src.base.range_checks import (
    as_floats,
    coerce_floats,
    coerce_integers,
    format_count,
)

_MAX_SIGMA = 1000.0


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
        coerce_floats(self, {"sigma": (MIN_POSITIVE, _MAX_SIGMA)}, RunError)
        if self.restart_after is not None:
            coerce_integers(self, {"restart_after": (1, MAX_GENERATIONS)}, RunError)
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
        if genes and isinstance(controller, str):  # one of a user is checked when it is made
            check_genotype("initial_genotype", genes, self.make_controller(organism))

    @property
    def validation_start(self) -> Any:
        """Start of validation trials: as the rules say, unless the run has a place of its own."""
        start = self.find_start()
        return self.validation.start if isinstance(start, str) else start
