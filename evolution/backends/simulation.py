"""The function that tries jobs: found by its name in every worker, and contained when it fails."""

import importlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from evolution.backends.trials import Job, Outcome, Trials, make_failure
from evolution.errors import RunError

log = logging.getLogger(__name__)

Simulate = Callable[[Sequence[Job], int], list[Outcome]]
"""Tries jobs, on so many threads; a function of a module, so that workers can import it by name."""


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
