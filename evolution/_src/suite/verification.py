"""The scores of a submission, computed again."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from evolution._src.references import check_allowed
from evolution._src.suite.submission import Entry, Score, Submission, find_score
from evolution._src.suite.tasks import find_suite_task
from reconstruction._src.base.progress import Progress, silent

TOLERANCE = 1e-6
"""Difference of fitness that other processors and versions of libraries may make [m]."""


class Check(NamedTuple):
    """An entry whose score was computed again.

    Attributes:
        entry: as submitted.
        scan: score in the arena, computed again.
        truth: score in the exact arena, computed again.
    """

    entry: Entry
    scan: Score
    truth: Score

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
            find_score(task, entry.body, entry.controller, entry.genotype, in_truth)
            for in_truth in (False, True)
        )
        checks.append(Check(entry, scan, truth))
    return checks
