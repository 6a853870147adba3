"""The trials of a genotype.

A `Job` describes everything that decides its outcome; the worker, the other jobs and the number of threads have no
influence. That is why batch, processes and a Ray cluster give equal results.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from evolution._src.backends.nested import Nested
from evolution._src.backends.nested import Options as Options
from evolution._src.backends.outcome import FAILED_PROGRESS, Outcome
from evolution._src.backends.parts import (
    BodyConfig,
    ControlConfig,
    EpisodeConfig,
    check_body_options,
    take_environment,
)
from evolution._src.backends.scoring import Scoring as Scoring
from evolution._src.backends.scoring import check_descriptors
from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from evolution._src.references import MAX_MAGNITUDE, MIN_POSITIVE
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import as_floats, as_range, check_count, coerce_floats
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.environment.config import RANDOM_LIMITS

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena

    ArenaSource: TypeAlias = str | PathLike[str] | Arena

MAX_ERROR_LENGTH = 200
"""Characters of an error that a record keeps."""
MAX_STRETCHES = 100
"""Each is a separate arena in memory."""
_STRETCH_LIMITS = (0.1, 10.0)
CONDITIONS = ("friction", "torque_scale", "start_offset", "yaw", "patch_friction")
"""Conditions of a trial that are sampled from a range, in this order, and set when the environment is reset."""
Range = tuple[float, float]


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
        patch_friction: where in their intervals the frictions of patches lie (`Arena.friction_map`): 0 is the middle,
            -1 and 1 are the ends of the 95 % interval; only for arenas with patches.
    """

    friction: Range = (0.55, 0.9)
    torque_scale: Range = (0.9, 1.1)
    start_offset: Range = (-0.05, 0.05)
    yaw: Range = (-0.0873, 0.0873)
    stretch: tuple[float, ...] = (0.975, 1.0, 1.025)
    patch_friction: Range = (0.0, 0.0)

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
        names = [name for name in CONDITIONS if name != "patch_friction"]
        conditions = {name: _sample_stratified(rng, getattr(self, name), count) for name in names}
        turns = np.resize(rng.permutation(len(self.stretch)), count)
        conditions |= {"stretch": np.asarray(self.stretch, dtype=float)[turns]}
        if self.patch_friction != (0.0, 0.0):
            # The last to be drawn: the others are those of the seeds of existing runs.
            conditions |= {"patch_friction": _sample_stratified(rng, self.patch_friction, count)}
        return conditions


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
        batch_sizes: sub-environments of a vector environment; the smallest size that takes all trials is used, or a
            larger one that is compiled already. Few sizes mean few compilations. Changes the speed only.
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
class TrialConfig:
    """How trials vary, how they are simulated and what is kept of them.

    Attributes:
        randomization: ranges from which the conditions of the trials are sampled.
        rollout: parameters of the simulation of trials.
        descriptors: what outcomes keep of every trial beside progress and success: "pose" (final positions and
            rotations), "extremes" (lowest and highest positions), "contacts", "trajectory" (thinned), recorders of
            `symbrion_gym._src.tasks.recorders`, or functions of a `TaskState`. None by default, as some cost time.
    """

    randomization: Randomization = field(default_factory=Randomization)
    rollout: RolloutConfig = field(default_factory=RolloutConfig)
    descriptors: Any = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "descriptors", check_descriptors(self.descriptors))


@dataclass(frozen=True, init=False)
class Trials(Nested):
    """The trials of a genotype. Fields of parts are given and read as its own: `Trials(modules=5, start="floor")`.

    Attributes:
        arena: name, folder, file or, on backend "batch", an `Arena`.
        body: the body.
        episode: what is to be done; options that are no field go to its `environment`.
        control: the controller that reads the genotype.
        trial: how the trials vary and are simulated.
        count: number of trials, each under other conditions.
        seed: seed of the conditions; equal seeds mean equal conditions.
    """

    PARTS: ClassVar[tuple[str, ...]] = ("body", "episode", "control", "trial")

    arena: ArenaSource = "truth"
    body: BodyConfig = field(default_factory=BodyConfig)
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)
    control: ControlConfig = field(default_factory=partial(ControlConfig, controller="reactive"))
    trial: TrialConfig = field(default_factory=TrialConfig)
    count: int = 2
    seed: tuple[int, ...] = (0,)

    def check_given(self, values: Mapping[str, Any]) -> None:
        """Refuse two bodies."""
        check_body_options(values)

    def take_others(self, others: dict[str, Any]) -> None:
        """Take further options of the environment."""
        take_environment(self, others)


def find_trial_controller(trials: Trials) -> Controller:
    """Return the controller of trials, for their body."""
    return trials.control.make_controller(trials.body.find_organism(), trials.episode)


class Job(NamedTuple):
    """One genotype and its trials."""

    genotype: Float[np.ndarray, " G"]
    trials: Trials


def make_failure(trials: Trials, error: str) -> Outcome:
    """Return the outcome of a job that could not be tried."""
    return Outcome(FAILED_PROGRESS, 0.0, (False,) * trials.count, error=error[:MAX_ERROR_LENGTH])


MAX_ARENAS = 4
"""Arenas that a process keeps."""
_arenas: OrderedDict[tuple[str, int], Arena] = OrderedDict()


def find_arena_key(arena: ArenaSource) -> object:
    """Return what tells arenas apart: a name, a path and when it was written, or the identity of an `Arena`."""
    if not isinstance(arena, str | PathLike):
        return id(arena)
    return arena if arena in NAMED_ARENAS else (str(arena), _find_time(Path(arena)))


def prepare_arena(arena: ArenaSource, progress: Progress = silent) -> ArenaSource:
    """Return an arena, loaded or built where it is a file or a folder; the next call returns the same one."""
    if not isinstance(arena, str | PathLike) or arena in NAMED_ARENAS:
        return arena
    key = str(arena), _find_time(Path(arena))
    if key not in _arenas:
        from symbrion_gym._src.arenas.loading import load_arena

        found = load_arena(str(arena), progress=progress)
        while len(_arenas) >= MAX_ARENAS:
            _arenas.popitem(last=False)
        _arenas[key] = found
    _arenas.move_to_end(key)
    return _arenas[key]


def _find_time(path: Path) -> int:
    """Return when an arena was written [ns]; 0 where there is none."""
    try:
        return (path / "arena.json" if path.is_dir() else path).stat().st_mtime_ns
    except OSError:
        return 0
