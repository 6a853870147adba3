"""How much is measured: everything that decides what the experiments return, but for the machine."""

import dataclasses
import json
from dataclasses import dataclass
from typing import Any

from evolution.errors import RunError
from reconstruction.files.typed_json import JsonError, as_type
from symbrion_gym.arenas.course import Course

PIT = Course().pit
"""Width of the pit of the true arena [m]."""


@dataclass(frozen=True)
class PaperConfig:
    """Sizes and numbers of runs of the experiments.

    Attributes:
        gsrm_units: sizes of the GSRM, Table I and Fig. 4.
        gg_triangles: sizes of the growing grid, Table I and Fig. 5.
        cold_starts: time every network in a fresh process that finds nothing compiled, too.
        modules: length of the snake.
        generations: of the evolution, at most.
        trials: randomised trials of every judgement.
        runs: crossings that are timed in each arena, Table II.
        steps: physics steps of each.
        scans: laser scans that are timed for each way of scanning, Table III.
        brute_scans: likewise, at least, of the brute-force way, which takes so much longer.
        widened: how much narrower the pit was when it was surveyed for the first time [m].
        widened_generations: of the evolutions before and after the pit was widened.
        model_generations: of an evolution in the arena of every size of the networks; 0 leaves them out.
        film_rate: frames a second of the films.
        seed: of everything that is drawn.
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
    film_rate: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        for name in (
            "modules",
            "generations",
            "trials",
            "runs",
            "steps",
            "scans",
            "brute_scans",
            "film_rate",
        ):
            if getattr(self, name) < 1:
                raise RunError(f"{name} is {getattr(self, name)}; at least 1 is needed")
        if not (self.gsrm_units and self.gg_triangles):
            raise RunError("gsrm_units and gg_triangles need at least one size each")
        if not 0 < self.widened <= 0.2:
            raise RunError(f"widened is {self.widened}; above 0, at most 0.2 m (a pit that was 0.2 m wide)")

    @property
    def arena_units(self) -> int:
        """Size of the GSRM that the arena is made of: 2200 as in the paper, or the nearest there is."""
        return min(self.gsrm_units, key=lambda units: abs(units - 2200))

    @property
    def arena_triangles(self) -> int:
        """Size of the growing grid that the arena is made of: the finest, as in the paper."""
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
    film_rate=8,
)
"""A reduced version, within three minutes on two cores."""
