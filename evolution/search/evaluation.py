"""Genotypes to fitness, by whichever backend."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from evolution.backends.batch import BatchBackend
from evolution.backends.simulation import Simulate, find_simulate
from evolution.backends.trials import Job, Outcome, Randomisation, Scoring, Trials
from evolution.errors import RunError

BACKENDS = ("batch", "processes", "ray")


class Backend(Protocol):
    """Who runs the jobs."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        ...

    def close(self) -> None:
        """Let the workers go."""
        ...


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
    simulate = simulate or find_simulate("evolution.backends.rollout:simulate")
    if name == "batch":
        return BatchBackend(simulate, workers)
    if name == "processes":
        from evolution.backends.processes import ProcessBackend

        return ProcessBackend(simulate, workers)
    if name == "ray":
        from evolution.backends.cluster import RayBackend

        return RayBackend(simulate, workers, address)
    raise RunError(f"there is no backend {name!r}; there are {', '.join(BACKENDS)}")


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
