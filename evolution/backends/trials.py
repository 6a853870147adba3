"""The trials of a genotype, their outcome, and its fitness.

A `Job` describes everything that decides its outcome; the worker, the other jobs and the number of threads have no
influence. That is why batch, processes and a Ray cluster give equal results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from evolution.controllers.controller import ControllerConfig
from evolution.errors import RunError
from evolution.limits import MAX_MAGNITUDE, MIN_POSITIVE
from reconstruction.range_checks import as_floats, as_range, check_count, coerce_floats
from symbrion_gym.environment.config import RANDOM_LIMITS

if TYPE_CHECKING:
    from symbrion_gym.arenas.arena import Arena

    ArenaSource: TypeAlias = str | PathLike[str] | Arena

FAILED_PROGRESS = -1.0
"""Progress [m] of a trial that could not be finished: below any that a finished trial can have."""
MAX_ERROR_LENGTH = 200
"""Characters of an error that a record keeps."""
MAX_STRETCHES = 100
"""Each is a separate arena in memory."""
MAX_WEIGHT = 1e6
"""Largest weight of a term of the fitness [m of progress]."""
_STRETCH_LIMITS = (0.1, 10.0)
CONDITIONS = ("friction", "torque_scale", "start_offset", "yaw")
"""Conditions of a trial that are sampled from a range, in this order, and set when the environment is reset."""
Range = tuple[float, float]
Options = tuple[tuple[str, Any], ...]
"""Name and value of each option of the environment, sorted by name."""


@dataclass(frozen=True)
class Randomization:
    """Ranges that the conditions of trials are sampled from.

    Sampling is uniform and stratified (a Latin hypercube): of n trials each lies in another n-th of every range,
    which reduces the variance of their mean.

    Attributes:
        friction: sliding friction between tracks and ground.
        torque_scale: strength of the hinges relative to the nominal one.
        start_offset: along the course [m].
        yaw: heading at the start [rad].
        stretch: factors on the length of the arena, as the scan may be wrong; the trials take turns.
    """

    friction: Range = (0.55, 0.9)
    torque_scale: Range = (0.9, 1.1)
    start_offset: Range = (-0.05, 0.05)
    yaw: Range = (-0.0873, 0.0873)
    stretch: tuple[float, ...] = (0.975, 1.0, 1.025)

    def __post_init__(self) -> None:
        for name in CONDITIONS:
            object.__setattr__(
                self, name, as_range(name, getattr(self, name), *RANDOM_LIMITS[name], RunError)
            )
        object.__setattr__(self, "stretch", as_floats("stretch", self.stretch, *_STRETCH_LIMITS, RunError))
        check_count("stretch", self.stretch, MAX_STRETCHES, RunError)

    def draw(self, seed: Sequence[int], count: int) -> dict[str, Float[np.ndarray, " T"]]:
        """Sample `count` values of each condition; equal seeds give equal values."""
        rng = np.random.default_rng(list(seed))
        conditions = {name: _sample_stratified(rng, getattr(self, name), count) for name in CONDITIONS}
        turns = np.resize(rng.permutation(len(self.stretch)), count)
        return conditions | {"stretch": np.asarray(self.stretch, dtype=float)[turns]}


def _sample_stratified(rng: np.random.Generator, limits: Range, count: int) -> Float[np.ndarray, " T"]:
    # scipy.stats.qmc.LatinHypercube draws in another order: other conditions for the seeds of existing runs
    share = (rng.permutation(count) + rng.uniform(size=count)) / count
    return limits[0] + (limits[1] - limits[0]) * share


@dataclass(frozen=True)
class RolloutConfig:
    """How trials are simulated.

    Attributes:
        stuck_time: a body without progress for this long ends its trial [s], unless the options of the environment say
            otherwise. Shorter than the environment's default: a controller without memory that made no progress in 5 s
            will make none. Changes results.
        batch_sizes: sub-environments of a vector environment; the smallest size that takes all trials is used. Few
            sizes mean few compilations. Changes the speed only.
        max_environments: compiled vector environments that a process keeps. Changes the speed and memory only.
    """

    stuck_time: float = 5.0
    batch_sizes: tuple[int, ...] = (8, 16, 24, 36, 48)
    max_environments: int = 12

    def __post_init__(self) -> None:
        coerce_floats(self, {"stuck_time": (MIN_POSITIVE, MAX_MAGNITUDE)}, RunError)
        object.__setattr__(self, "batch_sizes", tuple(self.batch_sizes))
        if not self.batch_sizes or min(self.batch_sizes) < 1 or self.max_environments < 1:
            raise RunError(
                f"batch_sizes is {self.batch_sizes} and max_environments {self.max_environments}; "
                "at least one each, from 1, is needed"
            )


@dataclass(frozen=True)
class Trials:
    """The trials of a genotype.

    Attributes:
        arena: name, folder or, on backend "batch", an `Arena`.
        modules: number of modules in the snake.
        controller: name of the law that reads the genotype.
        start: "pit" (close before it) or "floor".
        count: number of trials, each under other conditions.
        seed: seed of the conditions; equal seeds mean equal conditions.
        randomization: ranges from which the conditions are sampled.
        environment: further options of the environment, as sorted pairs.
        controller_config: parameters of the controller that are not evolved.
        rollout: parameters of the simulation.
    """

    arena: ArenaSource = "truth"
    modules: int = 8
    controller: str = "reactive"
    start: str = "pit"
    count: int = 2
    seed: tuple[int, ...] = (0,)
    randomization: Randomization = field(default_factory=Randomization)
    environment: Options = ()
    controller_config: ControllerConfig = field(default_factory=ControllerConfig)
    rollout: RolloutConfig = field(default_factory=RolloutConfig)


class Job(NamedTuple):
    """One genotype and its trials."""

    genotype: Float[np.ndarray, " G"]
    trials: Trials


@dataclass(frozen=True)
class Outcome:
    """The result of a genotype's trials.

    Attributes:
        progress: progress of the whole body, mean over trials [m].
        effort: mean over trials.
        succeeded: for each trial, whether the strict success check passed.
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
        """Number of successful trials."""
        return sum(self.succeeded)


@dataclass(frozen=True)
class Scoring:
    """How an outcome becomes a fitness: progress + success - effort - body.

    Attributes:
        success: reward of a success rate of 1 [m of progress].
        effort: penalty for a unit of effort.
        module: penalty for each module; only relevant where the length of the body evolves.
    """

    success: float = 1.0
    effort: float = 0.2
    module: float = 0.05

    def __post_init__(self) -> None:
        coerce_floats(
            self, dict.fromkeys(("success", "effort", "module"), (-MAX_WEIGHT, MAX_WEIGHT)), RunError
        )

    def score(self, outcome: Outcome, modules: int) -> float:
        """Return the fitness, higher is better, always finite."""
        rate = outcome.successes / max(outcome.trials, 1)
        return outcome.progress + self.success * rate - self.effort * outcome.effort - self.module * modules


def make_failure(trials: Trials, error: str) -> Outcome:
    """Return the outcome of a job that could not be tried."""
    return Outcome(FAILED_PROGRESS, 0.0, (False,) * trials.count, error=error[:MAX_ERROR_LENGTH])
