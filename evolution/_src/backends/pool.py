"""Where jobs run: in this process, or over workers that may die, where no job is lost and none is counted twice."""

import importlib
import logging
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from evolution._src.backends.scoring import Outcome
from evolution._src.backends.trials import Job, make_failure
from evolution._src.errors import RunError

BATCHES_PER_WORKER = 2
"""About how many batches of jobs each worker gets in a generation. 2 keeps the wait for the slowest batch
short; more would leave the batch of a worker too small."""
MAX_DEATHS = 2
"""A job that was alone on this many workers when they died is reported as failed. 2, because one death may
have any reason."""
logger = logging.getLogger(__name__)
Worker = TypeVar("Worker")
Reply: TypeAlias = tuple[
    Worker, list[Outcome] | None
]  # A worker, and the outcomes of its jobs; None if it died
Simulate = Callable[[Sequence[Job], int], list[Outcome]]
"""Tries jobs on a number of threads. Worker processes import it by name, so for them it is a function of a module."""


def run_isolated(simulate: Simulate, jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Run jobs such that one that raises, or returns invalid numbers, affects no other."""
    try:
        outcomes = simulate(jobs, threads)
        if len(outcomes) != len(jobs):
            raise ValueError(f"{len(outcomes)} outcomes for {len(jobs)} jobs")
    except RunError:
        raise  # the run is wrong, not a genotype
    except Exception as error:
        if len(jobs) == 1:
            logger.warning("a genotype could not be tried: %s", error)
            return [make_failure(jobs[0].trials, f"{type(error).__name__}: {error}")]
        return [run_isolated(simulate, [job], threads)[0] for job in jobs]
    for place, (outcome, job) in enumerate(zip(outcomes, jobs, strict=True)):
        if not np.isfinite((outcome.progress, outcome.effort)).all():
            failure = make_failure(job.trials, outcome.error or "progress or effort is not finite")
            diverged = max(outcome.diverged, 1)
            outcomes[place] = replace(failure, diverged=diverged, seconds=outcome.seconds)
    return outcomes


def name_simulate(simulate: Simulate) -> str:
    """Return "module:function", by which a worker finds it."""
    module, name = simulate.__module__, getattr(simulate, "__qualname__", "<no function>")
    if "<" in name:
        raise RunError(f"workers cannot import {module}:{name}; simulate must be a function of a module")
    return f"{module}:{name}"


def find_simulate(name: str) -> Simulate:
    """Import the function that `name_simulate` named."""
    module, function = name.split(":")
    return getattr(importlib.import_module(module), function)


class BatchBackend:
    """All jobs in this process, on the threads of `mujoco.batch`."""

    def __init__(self, simulate: Simulate, workers: int) -> None:
        self._simulate, self._workers = simulate, workers

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        return run_isolated(self._simulate, jobs, self._workers) if jobs else []

    def close(self) -> None:
        """Do nothing: there are no workers to stop."""


class WorkerPool(ABC, Generic[Worker]):
    """Distributes jobs over workers, replaces those that die and submits their jobs again."""

    def __init__(self, workers: int) -> None:
        self._num_wanted = workers
        self._workers: list[Worker] = []

    @abstractmethod
    def _start(self) -> Worker:
        """Start a worker and return it, ready."""

    @abstractmethod
    def _submit(self, worker: Worker, jobs: list[Job]) -> None:
        """Send jobs to a worker; if it is dead already, `_wait` reports it."""

    @abstractmethod
    def _wait(self, busy: Sequence[Worker]) -> list[Reply[Worker]]:
        """Block until at least one busy worker has replied or died."""

    @abstractmethod
    def _stop(self, worker: Worker) -> None:
        """Stop a worker, dead or alive."""

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Return one outcome for each job, in order."""
        count = len(jobs)
        size = max(1, -(-count // (BATCHES_PER_WORKER * self._num_wanted)))
        pending = deque(list(range(first, min(first + size, count))) for first in range(0, count, size))
        outcomes: dict[int, Outcome] = {}
        busy: dict[int, tuple[Worker, list[int]]] = {}
        deaths: Counter[int] = Counter()
        try:
            while len(outcomes) < len(jobs):
                self._assign(jobs, pending, busy)
                for worker, result in self._wait([worker for worker, _ in busy.values()]):
                    _, indices = busy.pop(id(worker))
                    if result is not None:
                        outcomes.update(zip(indices, result, strict=True))
                        continue
                    self._remove(worker)
                    for index in indices:
                        deaths[index] += len(indices) == 1
                        if deaths[index] < MAX_DEATHS:
                            pending.append([index])
                        else:
                            outcomes[index] = make_failure(
                                jobs[index].trials, f"its worker died {MAX_DEATHS} times"
                            )
        except BaseException:
            for worker, _ in busy.values():  # their replies would be taken for those of the next jobs
                self._remove(worker)
            raise
        return [outcomes[index] for index in range(len(jobs))]

    def close(self) -> None:
        """Stop all workers."""
        for worker in self._workers:
            self._stop(worker)
        self._workers.clear()

    def _assign(
        self, jobs: Sequence[Job], pending: deque[list[int]], busy: dict[int, tuple[Worker, list[int]]]
    ) -> None:
        while len(self._workers) < min(self._num_wanted, len(busy) + len(pending)):
            self._workers.append(self._start())
        for worker in self._workers:
            if pending and id(worker) not in busy:
                indices = pending.popleft()
                busy[id(worker)] = (worker, indices)
                self._submit(worker, [jobs[index] for index in indices])

    def _remove(self, worker: Worker) -> None:
        self._workers.remove(worker)
        self._stop(worker)
