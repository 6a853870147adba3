"""Fill a submission entry by entry, so that a run that was stopped goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from evolution._src.backends.making import make_backend
from evolution._src.backends.simulation import Simulate
from evolution._src.errors import RunError
from evolution._src.search.run import describe_origin
from evolution._src.suite.baselines import find_method, run_baseline
from evolution._src.suite.submission import Entry, Submission, load_submission
from evolution._src.suite.tasks import BUDGET, SUITE, SuiteTask, find_suite_task
from reconstruction._src.base.progress import Progress, silent

FindEntry = Callable[[SuiteTask, int], Entry]
"""From a task and a seed to what a method has found."""


def run_suite(
    method: str,
    seeds: Sequence[int],
    tasks: Sequence[str] = (),
    budget: float = BUDGET,
    workers: int = 1,
    progress: Progress = silent,
    simulate: Simulate | None = None,
    out: Path | None = None,
) -> Submission:
    """Return what a baseline finds."""
    suited = [task for task in SUITE if find_method(method).suits(task)]
    chosen = [find_suite_task(name) for name in tasks] or suited
    name = method if budget == BUDGET else f"{method}, {budget:g} s"
    backend = make_backend("batch", workers, simulate=simulate)
    try:
        return fill_submission(
            name,
            lambda task, seed: run_baseline(method, task, seed, backend, budget),
            [(task, seed) for seed in seeds for task in chosen],
            describe_origin() | {"method": method, "budget": budget},
            out,
            progress,
        )
    finally:
        backend.close()


def fill_submission(
    name: str,
    find_entry: FindEntry,
    pairs: Sequence[tuple[SuiteTask, int]],
    provenance: Mapping[str, Any],
    out: Path | None = None,
    progress: Progress = silent,
) -> Submission:
    """Return a submission with an entry for each task and seed; those that the file has are kept."""
    submission = Submission(name, (), provenance)
    if out is not None and out.exists():
        submission = _continue(submission, out)
    for number, (task, seed) in enumerate(pairs):
        if any(entry.task == task.name and entry.seed == seed for entry in submission.entries):
            continue
        progress(f"{task.name}, seed {seed}", number / len(pairs))
        entries = (*submission.entries, find_entry(task, seed))
        submission = Submission(name, entries, provenance)
        if out is not None:
            submission.save(out)
    return submission


def _continue(begun: Submission, out: Path) -> Submission:
    """Return the submission of a file that the same run has written."""
    known = load_submission(out)
    differing = [
        key
        for key in {**known.provenance, **begun.provenance}
        if known.provenance.get(key) != begun.provenance.get(key)
    ]
    if known.name != begun.name or differing:
        what = ", ".join(differing) or "name"
        raise RunError(f"{out} is a submission of another run (it differs in: {what}); name another file")
    return known
