"""Fill a submission entry by entry, so that a run that was stopped goes on."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from evolution._src.backends.cluster import make_backend
from evolution._src.backends.pool import Simulate
from evolution._src.errors import RunError
from evolution._src.references import check_allowed
from evolution._src.search.run import describe_origin
from evolution._src.suite.baselines import find_method, run_baseline
from evolution._src.suite.submission import Entry, Score, Submission, compute_score, load_submission
from evolution._src.suite.tasks import BUDGET, SUITE, SuiteTask, find_suite_task
from reconstruction._src.base.progress import Progress, silent

FindEntry = Callable[[SuiteTask, int], Entry]  # From a task and a seed to what a method has found


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


TOLERANCE = 1e-6  # Difference of fitness that other processors and versions of libraries may make [m]


class Check(NamedTuple):
    """An entry whose score was computed again."""

    entry: Entry  # as submitted
    scan: Score  # score in the arena, computed again
    truth: Score  # score in the exact arena, computed again

    @property
    def holds(self) -> bool:
        """Whether both scores are those of the submission."""
        pairs = (self.entry.scan, self.scan), (self.entry.truth, self.truth)
        return all(
            told.successes == found.successes and abs(told.fitness - found.fitness) <= TOLERANCE
            for told, found in pairs
        )


def verify(
    submission: Submission,
    progress: Progress = silent,
    tasks: Sequence[str] = (),
    allow: Collection[str] = (),
) -> list[Check]:
    """Run every genotype of a submission again, on the scan and in the truth."""
    names = {find_suite_task(name).name for name in tasks}
    entries = [entry for entry in submission.entries if not names or entry.task in names]
    for entry in entries:
        if ":" in entry.controller:
            check_allowed(entry.controller, "controller", allow)
    checks = []
    for number, entry in enumerate(entries):
        progress(entry.task, number / len(entries))
        task = find_suite_task(entry.task)
        scan, truth = (
            compute_score(task, entry.body, entry.controller, entry.genotype, in_truth)
            for in_truth in (False, True)
        )
        checks.append(Check(entry, scan, truth))
    return checks
