"""The function that tries jobs: found by its name in every worker, and isolated from jobs that fail."""

import importlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from evolution._src.backends.trials import Job, Outcome, Trials, make_failure
from evolution._src.errors import RunError

logger = logging.getLogger(__name__)

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
    return [_replace_non_finite(outcome, job.trials) for outcome, job in zip(outcomes, jobs, strict=True)]


def _replace_non_finite(outcome: Outcome, trials: Trials) -> Outcome:
    if np.isfinite(outcome.progress) and np.isfinite(outcome.effort):
        return outcome
    failure = make_failure(trials, outcome.error or "progress or effort is not finite")
    return replace(failure, diverged=max(outcome.diverged, 1), seconds=outcome.seconds)


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
