"""What a genotype is put to, what came of it, and what that is worth.

A `Job` says everything that decides its outcome; who runs it, beside which others and on how many
threads decides nothing. That is why batch, processes and a Ray cluster give equal results.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from evolution.errors import RunError
from evolution.limits import as_floats, settle_numbers
from symbrion_gym.environment.config import RANDOM_LIMITS

FAILED_PROGRESS = -1.0
"""Progress [m] of a trial that could not be finished: worse than any that could."""
MOST_STRETCHES = 100
"""Each is an arena of its own in memory."""
LARGEST_WORTH = 1e6
"""Largest weight of a term of the fitness [m of progress]."""
Range = tuple[float, float]


@dataclass(frozen=True)
class Randomisation:
    """Ranges that the conditions of trials are drawn from.

    Uniformly, and spread evenly over each range (a Latin hypercube): two trials never lie in the same
    half of a range, so that little luck is left in their mean.

    Attributes:
        friction: sliding friction between tracks and ground.
        torque_scale: strength of the hinges relative to the nominal one.
        start_offset: along the course [m].
        yaw: heading at the start [rad].
        stretch: how much longer the arena may really be than the scan says; the trials take turns.
    """

    friction: Range = (0.55, 0.9)
    torque_scale: Range = (0.9, 1.1)
    start_offset: Range = (-0.05, 0.05)
    yaw: Range = (-0.0873, 0.0873)
    stretch: tuple[float, ...] = (0.975, 1.0, 1.025)

    def __post_init__(self) -> None:
        for name in ("friction", "torque_scale", "start_offset", "yaw"):
            limits = as_floats(name, getattr(self, name), *RANDOM_LIMITS[name])
            if len(limits) != 2:
                raise RunError(f"{name} is {limits}; a lowest and a highest value are needed")
            object.__setattr__(self, name, limits)
        object.__setattr__(self, "stretch", as_floats("stretch", self.stretch, 0.1, 10.0))
        if not 1 <= len(self.stretch) <= MOST_STRETCHES:
            raise RunError(f"stretch has {len(self.stretch)} values; 1 to {MOST_STRETCHES} are possible")

    def draw(self, seed: Sequence[int], count: int) -> dict[str, np.ndarray]:
        """Return `[count]` values of each condition; equal seeds give equal values."""
        generator = np.random.default_rng(list(seed))
        ranges = (("friction", self.friction), ("torque_scale", self.torque_scale))
        ranges += (("start_offset", self.start_offset), ("yaw", self.yaw))
        conditions = {name: _spread(generator, limits, count) for name, limits in ranges}
        turns = np.resize(generator.permutation(len(self.stretch)), count)
        return conditions | {"stretch": np.asarray(self.stretch, dtype=float)[turns]}


def _spread(generator: np.random.Generator, limits: Range, count: int) -> np.ndarray:
    share = (generator.permutation(count) + generator.uniform(size=count)) / count
    return limits[0] + (limits[1] - limits[0]) * share


@dataclass(frozen=True)
class Trials:
    """The trials that a genotype is put to.

    Attributes:
        arena: name or folder.
        modules: number of modules in the snake.
        controller: name of the law that reads the genotype.
        start: "pit" (close before it) or "floor".
        count: number of trials, each under other conditions.
        seed: of the conditions; equal seeds mean equal conditions.
        randomisation: what the conditions are drawn from.
        environment: further options of the environment, as sorted pairs.
    """

    arena: Any = "truth"
    modules: int = 8
    controller: str = "reactive"
    start: str = "pit"
    count: int = 2
    seed: tuple[int, ...] = (0,)
    randomisation: Randomisation = field(default_factory=Randomisation)
    environment: tuple[tuple[str, Any], ...] = ()


class Job(NamedTuple):
    """One genotype and its trials."""

    genotype: np.ndarray
    trials: Trials


@dataclass(frozen=True)
class Outcome:
    """What happened to a genotype.

    Attributes:
        progress: of the whole body, mean over trials [m].
        effort: mean over trials.
        succeeded: for each trial, whether the strict test held.
        seconds: simulated, summed over trials [s].
        diverged: number of trials whose physics diverged.
        error: why it could not be tried; empty if it could.
    """

    progress: float
    effort: float
    succeeded: tuple[bool, ...]
    seconds: float = 0.0
    diverged: int = 0
    error: str = ""

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.succeeded)

    @property
    def successes(self) -> int:
        """Number of trials that held."""
        return sum(self.succeeded)


@dataclass(frozen=True)
class Scoring:
    """How an outcome becomes a fitness: progress + success - effort - body.

    Attributes:
        success: worth of a success [m of progress].
        effort: price of a unit of effort.
        module: price of each module; only bodies of evolved length differ in it.
    """

    success: float = 1.0
    effort: float = 0.2
    module: float = 0.05

    def __post_init__(self) -> None:
        settle_numbers(self, dict.fromkeys(("success", "effort", "module"), (-LARGEST_WORTH, LARGEST_WORTH)))

    def score(self, outcome: Outcome, modules: int) -> float:
        """Return the fitness, higher is better, always finite."""
        rate = outcome.successes / max(outcome.trials, 1)
        return outcome.progress + self.success * rate - self.effort * outcome.effort - self.module * modules


def make_failure(trials: Trials, error: str) -> Outcome:
    """Return the outcome of a job that could not be done."""
    return Outcome(FAILED_PROGRESS, 0.0, (False,) * trials.count, error=error[:200])
