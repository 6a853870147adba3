"""What the story of a swarm is made with."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_counts, check_positive
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights

LEAST_ROBOTS = 2
BASELINE_TIME = 300.0
"""A swarm that may not dock explores for so long [s]."""


@dataclass(frozen=True)
class StoryConfig:
    """Configuration of `tell_story`.

    Attributes:
        arena: a name, folder or file of an arena with a pit.
        seed: decides everything: equal seeds give equal results.
        num_robots: Scouts; all of them form one snake.
        docks: whether they may dock; without, they only explore, as a baseline.
        gather_time: longest time until the organism is whole [s].
        cross_time: longest crossing [s].
        part_time: longest time until all have gone on [s].
        weights: of the behaviors.

    Raises:
        RunError: a value is out of range.
    """

    arena: str = "gsrm"
    seed: int = 0
    num_robots: int = 8
    docks: bool = True
    gather_time: float = 2400.0
    cross_time: float = 120.0
    part_time: float = 120.0
    weights: BehaviorWeights = field(default_factory=BehaviorWeights)

    def __post_init__(self) -> None:
        check_counts(self, ("num_robots",), RunError)
        if self.num_robots < LEAST_ROBOTS:
            raise RunError(f"num_robots is {self.num_robots}; an organism needs at least {LEAST_ROBOTS}")
        if self.seed < 0:
            raise RunError(f"seed is {self.seed}; give 0 or more")
        check_positive(self, ("gather_time", "cross_time", "part_time"), RunError)

    def describe(self) -> dict[str, Any]:
        """Return what decides the results, for JSON."""
        return json.loads(json.dumps(dataclasses.asdict(self)))


@dataclass(frozen=True)
class SwarmRunConfig:
    """Configuration of `run_swarm`.

    Attributes:
        folder: output folder.
        story: the story of the first seed.
        trials: stories with other seeds, `story.seed + 1` on, without film.
        champion: file or folder of the champion that crosses; None to evolve one in the arena.
        generations: limit of its evolution.
        workers: threads of its evolution; the results do not depend on their number.
        film: whether to film the first story.
        allow: modules of yours that the champion names and that may be imported.
    """

    folder: Path
    story: StoryConfig = field(default_factory=StoryConfig)
    trials: int = 0
    champion: Path | None = None
    generations: int = 30
    workers: int = 1
    film: bool = True
    allow: tuple[str, ...] = ()
