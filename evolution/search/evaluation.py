"""The fitness of genotypes, on any backend."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Float, Num

from evolution.backends.batch import BatchBackend
from evolution.backends.pool import PoolConfig
from evolution.backends.simulation import Simulate, find_simulate
from evolution.backends.trials import Job, Outcome, Randomization, Scoring, Trials
from evolution.errors import RunError
from reconstruction.deprecation import accept_former_arguments
from reconstruction.range_checks import check_choice

if TYPE_CHECKING:
    from evolution.backends.trials import ArenaSource

BACKENDS = ("batch", "processes", "ray")


class Backend(Protocol):
    """Runs jobs on its workers."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        ...

    def close(self) -> None:
        """Stop the workers."""
        ...


def make_backend(
    name: str = "batch",
    workers: int = 1,
    address: str | None = None,
    simulate: Simulate | None = None,
    pool: PoolConfig | None = None,
) -> Backend:
    """Make a backend.

    Args:
        name: "batch", "processes" or "ray".
        workers: threads, processes or actors.
        address: address of an existing Ray cluster; None starts a local one.
        simulate: the function that tries jobs; None means physics.
        pool: parameters of the distribution of jobs to processes or actors, and their time limits.

    Raises:
        RunError: unknown name, workers below 1, or Ray is not installed.
    """
    if workers < 1:
        raise RunError(f"workers is {workers}; at least 1 is needed")
    check_choice("backend", name, BACKENDS, RunError)
    simulate = simulate or find_simulate("evolution.backends.rollout:simulate")
    if name == "batch":
        return BatchBackend(simulate, workers)
    if name == "processes":
        from evolution.backends.processes import ProcessBackend

        return ProcessBackend(simulate, workers, pool)
    from evolution.backends.cluster import RayBackend

    return RayBackend(simulate, workers, address, pool)


class Evaluation(NamedTuple):
    """Fitness of genotypes, and the outcomes of their trials.

    Attributes:
        fitness: fitness of each genotype; higher is better.
        outcomes: outcome of each genotype.
    """

    fitness: Float[np.ndarray, " P"]
    outcomes: list[Outcome]


@accept_former_arguments(randomisation="randomization")
def evaluate(
    genotypes: Num[np.ndarray, "*P G"],
    arena: "ArenaSource" = "truth",
    modules: int = 8,
    seed: int = 0,
    *,
    trials: int = 2,
    controller: str = "reactive",
    start: str = "pit",
    randomization: Randomization | None = None,
    scoring: Scoring | None = None,
    backend: str = "batch",
    workers: int = 1,
    simulate: Simulate | None = None,
    **environment: Any,
) -> Evaluation:
    """Try genotypes under the same randomized conditions.

    Args:
        genotypes: one genotype per row, or a single one.
        arena: name, folder, or an `Arena` (backend "batch").
        modules: number of modules.
        seed: seed of the conditions.
        trials: number of trials of each genotype.
        controller: name of the controller that reads the genotypes.
        start: "pit" or "floor".
        randomization: ranges of the conditions.
        scoring: weights with which an outcome becomes a fitness.
        backend: "batch", "processes" or "ray"; the results are equal.
        workers: threads, processes or actors.
        simulate: the function that tries jobs; None means physics.
        environment: further options of `SnakePitEnv`.

    Raises:
        RunError: the genotypes do not fit the controller, or an argument is unknown or out of range.
    """
    from evolution.controllers.controller import make_controller

    genotypes = np.atleast_2d(np.asarray(genotypes, dtype=float))
    make_controller(controller, modules).check(genotypes)
    conditions = Trials(
        arena=arena,
        modules=modules,
        controller=controller,
        start=start,
        count=trials,
        seed=(seed,),
        randomization=randomization or Randomization(),
        environment=tuple(sorted(environment.items())),
    )
    runner = make_backend(backend, workers, simulate=simulate)
    try:
        outcomes = runner.run([Job(genotype, conditions) for genotype in genotypes])
    finally:
        runner.close()
    scoring = scoring or Scoring(module=0.0)
    return Evaluation(np.array([scoring.score(outcome, modules) for outcome in outcomes]), outcomes)
