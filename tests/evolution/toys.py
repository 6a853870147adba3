"""Stand-ins for physics: functions of a module, so that worker processes can import them."""

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evolution._src.backends.scoring import Outcome
from evolution._src.backends.trials import Job, Trials
from evolution._src.errors import RunError

MARK = "SYMBRION_TEST_MARK"
"""Environment variable that names a file; the first worker to see it missing makes it and dies."""


def make_jobs(count: int = 11, seed: int = 0) -> list[Job]:
    """Random genotypes of eight genes, three trials each."""
    genotypes = np.random.default_rng(seed).uniform(-1, 1, (count, 8))
    return [Job(genotype, Trials(seed=(seed, 1), count=3)) for genotype in genotypes]


def bowl(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Progress is highest where every gene is 0.5; the yaw of the trials adds noise."""
    return [_roll(job) for job in jobs]


def plain(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Nothing makes a difference."""
    return [Outcome(0.0, 0.0, (False,) * job.trials.count, seconds=1.0) for job in jobs]


def hopeless(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """The bowl, in which no trial succeeds."""
    return [
        Outcome(outcome.progress, outcome.effort, (False,) * outcome.trials, outcome.seconds)
        for outcome in bowl(jobs, threads)
    ]


def slow_bowl(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """The same, a few milliseconds a job."""
    time.sleep(0.002 * len(jobs))
    return bowl(jobs, threads)


def fragile(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Raise for genotypes with a first gene above 0.3."""
    if any(job.genotype[0] > 0.3 for job in jobs):
        raise FloatingPointError("the simulation fell apart")
    return bowl(jobs, threads)


def broken(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Raise for every genotype, as a term of a task with an error does."""
    raise AttributeError("no such field")


def nonsense(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Return a progress that is no number for a first gene above 0.3."""
    return [
        Outcome(np.nan, 0.0, (True,) * job.trials.count) if job.genotype[0] > 0.3 else _roll(job)
        for job in jobs
    ]


def wrong_run(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Find that the run itself is wrong."""
    raise RunError("no such arena")


def dies_once(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Kill the worker at the first call of all."""
    try:
        Path(os.environ[MARK]).touch(exist_ok=False)  # one of two workers at the same moment
    except FileExistsError:
        return bowl(jobs, threads)
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("killed")


def deadly(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Kill the worker whenever a first gene is above 0.3."""
    if any(job.genotype[0] > 0.3 for job in jobs):
        os.kill(os.getpid(), signal.SIGKILL)
    return bowl(jobs, threads)


class Observed:
    """Stand-in that records its jobs, in order.

    Args:
        successes: how many of n trials succeed, by n; all where it is missing.
    """

    def __init__(self, successes: dict[int, int] | None = None) -> None:
        self.jobs: list[Job] = []
        self._successes = successes or {}

    def __call__(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        self.jobs += jobs
        counts = [job.trials.count for job in jobs]
        flags = [[trial < self._successes.get(count, count) for trial in range(count)] for count in counts]
        return [
            Outcome(float(job.genotype.sum()), 0.0, tuple(succeeded), seconds=1.0)
            for job, succeeded in zip(jobs, flags, strict=True)
        ]


def find_conditions(job: Job) -> frozenset[float]:
    """Return the frictions of a job's trials, which differ between different conditions."""
    return frozenset(job.trials.randomization.draw(job.trials.seed, job.trials.count)["friction"])


def _roll(job: Job) -> Outcome:
    conditions = job.trials.randomization.draw(job.trials.seed, job.trials.count)
    distance = float(((job.genotype - 0.5) ** 2).sum())
    succeeded = tuple(bool(distance + 2 * (friction - 0.7) < 0.5) for friction in conditions["friction"])
    return Outcome(float(conditions["yaw"].sum()) - distance, 0.0, succeeded, seconds=1.0)
