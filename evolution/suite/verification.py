"""The scores of a submission, computed again."""

from __future__ import annotations

from typing import NamedTuple

from evolution.suite.submission import Entry, Score, Submission, find_score
from evolution.suite.tasks import find_suite_task
from reconstruction.progress import Progress, silent

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


def verify(submission: Submission, progress: Progress = silent) -> list[Check]:
    """Run every genotype of a submission again, on the scan and in the truth.

    A controller "module:name" is imported, which runs its code: verify only what you would run.

    Args:
        submission: what was read.
        progress: called with the task and the share done.

    Raises:
        RunError: a genotype cannot be tried.
    """
    checks = []
    for number, entry in enumerate(submission.entries):
        progress(entry.task, number / len(submission.entries))
        task = find_suite_task(entry.task)
        scan, truth = (
            find_score(task, entry.body, entry.controller, entry.genotype, in_truth)
            for in_truth in (False, True)
        )
        checks.append(Check(entry, scan, truth))
    return checks
