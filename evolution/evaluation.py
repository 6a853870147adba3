"""Genotypes to fitness: what a job is, what came of it, and who does it.

A `Job` says everything that decides its outcome; who runs it, beside which others and on how many
threads decides nothing. That is why batch, processes and a Ray cluster give equal results.
"""

import importlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from evolution.errors import RunError

FAILED_PROGRESS = -1.0
"""Progress [m] of a trial that could not be finished: worse than any that could."""
BACKENDS = ("batch", "processes", "ray")

log = logging.getLogger(__name__)

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

    def score(self, outcome: Outcome, modules: int) -> float:
        """Return the fitness, higher is better, always finite."""
        rate = outcome.successes / max(outcome.trials, 1)
        return outcome.progress + self.success * rate - self.effort * outcome.effort - self.module * modules


Simulate = Callable[[Sequence[Job], int], list[Outcome]]
"""Tries jobs, on so many threads; a function of a module, so that workers can import it by name."""


class Backend(Protocol):
    """Who runs the jobs."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        ...

    def close(self) -> None:
        """Let the workers go."""
        ...


def make_failure(trials: Trials, error: str) -> Outcome:
    """Return the outcome of a job that could not be done."""
    return Outcome(FAILED_PROGRESS, 0.0, (False,) * trials.count, error=error[:200])


def run_contained(simulate: Simulate, jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Run jobs such that one that raises, or returns nonsense, costs only itself."""
    try:
        outcomes = simulate(jobs, threads)
        if len(outcomes) != len(jobs):
            raise ValueError(f"{len(outcomes)} outcomes for {len(jobs)} jobs")
    except RunError:
        raise  # the run is wrong, not a genotype
    except Exception as error:
        if len(jobs) == 1:
            log.warning("a genotype could not be tried: %s", error)
            return [make_failure(jobs[0].trials, f"{type(error).__name__}: {error}")]
        return [run_contained(simulate, [job], threads)[0] for job in jobs]
    return [_checked(outcome, job.trials) for outcome, job in zip(outcomes, jobs, strict=True)]


def _checked(outcome: Outcome, trials: Trials) -> Outcome:
    if np.isfinite(outcome.progress) and np.isfinite(outcome.effort):
        return outcome
    failure = make_failure(trials, outcome.error or "progress or effort is not finite")
    return replace(failure, diverged=max(outcome.diverged, 1), seconds=outcome.seconds)


class BatchBackend:
    """All jobs in this process, on the threads of `mujoco.batch`."""

    def __init__(self, simulate: Simulate, workers: int) -> None:
        self._simulate, self._workers = simulate, workers

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        return run_contained(self._simulate, jobs, self._workers) if jobs else []

    def close(self) -> None:
        """Nothing is held."""


def make_backend(
    name: str = "batch", workers: int = 1, address: str | None = None, simulate: Simulate | None = None
) -> Backend:
    """Return a backend.

    Args:
        name: "batch", "processes" or "ray".
        workers: threads, processes or actors.
        address: of an existing Ray cluster; None starts a local one.
        simulate: what tries a job; None means physics.

    Raises:
        RunError: unknown name, workers below 1, or Ray is not installed.
    """
    if workers < 1:
        raise RunError(f"workers is {workers}; at least 1 is needed")
    simulate = simulate or find_simulate("evolution.rollout:simulate")
    if name == "batch":
        return BatchBackend(simulate, workers)
    if name == "processes":
        from evolution.process_backend import ProcessBackend

        return ProcessBackend(simulate, workers)
    if name == "ray":
        from evolution.ray_backend import RayBackend

        return RayBackend(simulate, workers, address)
    raise RunError(f"there is no backend {name!r}; there are {', '.join(BACKENDS)}")


def name_simulate(simulate: Simulate) -> str:
    """Return "module:function", by which a worker finds it."""
    name = f"{simulate.__module__}:{simulate.__qualname__}"
    if "<" in name:
        raise RunError(f"workers cannot import {name}; simulate must be a function of a module")
    return name


def find_simulate(name: str) -> Simulate:
    """Import the function that `name_simulate` named."""
    module, function = name.split(":")
    return getattr(importlib.import_module(module), function)


class Evaluation(NamedTuple):
    """Fitness of genotypes, and what happened to each.

    Attributes:
        fitness: `[P]`, higher is better.
        outcomes: one for each genotype.
    """

    fitness: np.ndarray
    outcomes: list[Outcome]


def evaluate(
    genotypes: np.ndarray,
    arena: Any = "truth",
    modules: int = 8,
    seed: int = 0,
    *,
    trials: int = 2,
    controller: str = "reactive",
    start: str = "pit",
    randomisation: Randomisation | None = None,
    scoring: Scoring | None = None,
    backend: str = "batch",
    workers: int = 1,
    simulate: Simulate | None = None,
    **environment: Any,
) -> Evaluation:
    """Try genotypes under the same randomised conditions.

    Args:
        genotypes: `[P, G]`, or `[G]` for one.
        arena: name, folder, or an `Arena` (backend "batch").
        modules: number of modules.
        seed: of the conditions.
        trials: how many each genotype gets.
        controller: the law that reads the genotypes.
        start: "pit" or "floor".
        randomisation: ranges of the conditions.
        scoring: how an outcome becomes a fitness.
        backend: "batch", "processes" or "ray"; the results are equal.
        workers: threads, processes or actors.
        simulate: what tries a job; None means physics.
        environment: further options of `SnakePitEnv`.

    Raises:
        RunError: the shape of the genotypes does not fit the controller.
    """
    from evolution.controller import make_controller

    genotypes = np.atleast_2d(np.asarray(genotypes, dtype=float))
    make_controller(controller, modules).check(genotypes)
    conditions = Trials(
        arena=arena,
        modules=modules,
        controller=controller,
        start=start,
        count=trials,
        seed=(seed,),
        randomisation=randomisation or Randomisation(),
        environment=tuple(sorted(environment.items())),
    )
    runner = make_backend(backend, workers, simulate=simulate)
    try:
        outcomes = runner.run([Job(genotype, conditions) for genotype in genotypes])
    finally:
        runner.close()
    scoring = scoring or Scoring(module=0.0)
    return Evaluation(np.array([scoring.score(outcome, modules) for outcome in outcomes]), outcomes)
