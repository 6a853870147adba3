"""Configuration of the experiments: everything that decides their results, except the machine."""

import dataclasses
import json
from dataclasses import dataclass
from typing import Any

from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_counts
from reconstruction._src.base.typed_json import JsonError, as_type
from symbrion_gym._src.arenas.course import Course

PIT = Course().pit
"""Width of the pit of the true arena [m]."""
LARGEST_WIDENING = 0.2
"""Beyond it the pit of the first survey would be narrower than a robot, and no pit at all [m]."""
PAPER_UNITS = 2200
"""Units of the GSRM that the paper's arena was made of."""


@dataclass(frozen=True)
class PaperConfig:
    """Sizes and numbers of repetitions.

    Attributes:
        gsrm_units: sizes of the GSRM, Table I and Fig. 4; 2200 is the paper's, the others show what a coarser and a
            finer network cost.
        gg_triangles: sizes of the growing grid, Table I and Fig. 5; 13860 is the paper's.
        cold_starts: also time every network in a fresh process without compiled programs, which adds a compilation
            and four reconstructions for each.
        modules: number of modules in the snake.
        generations: limit of the evolution, which stops earlier when a champion is confirmed.
        trials: randomized trials whenever a champion is judged; 18 of 20 are the success threshold.
        runs: crossings that are timed in each arena, Table II; 100 as in the paper.
        steps: physics steps that are timed in each crossing; 3500 as in the paper.
        scans: laser scans that are timed with each scan method, Table III; the interval of their ratio narrows with
            the square root of their number.
        brute_scans: the same for the brute-force method, which takes much longer.
        widened: widening of the pit after the first survey [m]; 5 cm are five times the localization
            error of the survey, so that the change can be seen.
        widened_generations: limit of the evolutions before and after the pit is widened.
        model_generations: limit of one evolution in the arena of every network of `gsrm_units` and `gg_triangles`;
            0 skips them.
        swarm_stories: stories of a swarm that gathers, crosses and parts, with seeds from `seed` on; 0 skips them.
        film_rate: frame rate of the videos [1/s].
        seed: seed of all random numbers.
    """

    gsrm_units: tuple[int, ...] = (800, 2200, 5000)
    gg_triangles: tuple[int, ...] = (210, 1500, 13860)
    cold_starts: bool = True
    modules: int = 8
    generations: int = 40
    trials: int = 20
    runs: int = 100
    steps: int = 3500
    scans: int = 1000
    brute_scans: int = 20
    widened: float = 0.05
    widened_generations: int = 40
    model_generations: int = 30
    swarm_stories: int = 1
    film_rate: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        counts = ("modules", "generations", "trials", "runs", "steps", "scans", "brute_scans", "film_rate")
        check_counts(self, counts, RunError)
        if not (self.gsrm_units and self.gg_triangles):
            raise RunError("gsrm_units and gg_triangles need at least one size each")
        if not 0 < self.widened <= LARGEST_WIDENING:
            raise RunError(f"widened is {self.widened}; it must be above 0 and at most {LARGEST_WIDENING} m")

    @property
    def arena_units(self) -> int:
        """Size of the GSRM that the arena is made of: of `gsrm_units` the nearest to the paper's 2200."""
        return min(self.gsrm_units, key=lambda units: abs(units - PAPER_UNITS))

    @property
    def arena_triangles(self) -> int:
        """Size of the growing grid that the arena is made of: the largest, as in the paper."""
        return max(self.gg_triangles)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content."""
        return json.loads(json.dumps(dataclasses.asdict(self)))

    @classmethod
    def from_json(cls, content: Any) -> "PaperConfig":
        """Return the configuration that `to_json` described.

        Raises:
            RunError: a field is unknown, of another type or out of range.
        """
        try:
            return as_type(content, cls)
        except JsonError as error:
            raise RunError(str(error)) from error


QUICK = PaperConfig(
    gsrm_units=(800, 2200),
    gg_triangles=(13860,),
    cold_starts=False,
    generations=5,
    trials=8,
    runs=3,
    scans=100,
    brute_scans=3,
    widened_generations=3,
    model_generations=0,
    swarm_stories=0,
    film_rate=8,
)
"""A reduced version, which takes three minutes on two cores."""
