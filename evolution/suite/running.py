"""A baseline on all tasks of the suite, as a submission."""

from __future__ import annotations

from collections.abc import Sequence

from evolution.backends.making import make_backend
from evolution.backends.simulation import Simulate
from evolution.search.run import describe_origin
from evolution.suite.baselines import run_baseline
from evolution.suite.submission import Submission
from evolution.suite.tasks import BUDGET, SUITE, find_suite_task
from reconstruction.progress import Progress, silent


def run_suite(
    method: str,
    seeds: Sequence[int],
    tasks: Sequence[str] = (),
    budget: float = BUDGET,
    workers: int = 1,
    progress: Progress = silent,
    simulate: Simulate | None = None,
) -> Submission:
    """Return what a baseline finds.

    Args:
        method: one of `evolution.suite.baselines.METHODS`.
        seeds: seeds of the method.
        tasks: names of the tasks; empty for all.
        budget: simulated time for a task and seed [s].
        workers: number of threads; they change nothing but the time.
        progress: called with the task and the share done.
        simulate: the function that tries jobs; None means physics.

    Raises:
        RunError: there is no such task.
    """
    chosen = [find_suite_task(name) for name in tasks] or list(SUITE)
    pairs = [(task, seed) for task in chosen for seed in seeds]
    backend = make_backend("batch", workers, simulate=simulate)
    entries = []
    try:
        for number, (task, seed) in enumerate(pairs):
            progress(f"{task.name}, seed {seed}", number / len(pairs))
            entries.append(run_baseline(method, task, seed, backend, budget))
    finally:
        backend.close()
    provenance = describe_origin() | {"method": method, "budget": budget}
    name = method if budget == BUDGET else f"{method}, {budget:g} s"
    return Submission(name, tuple(entries), provenance)
