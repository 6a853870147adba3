"""Submissions to the benchmark suite: entries of a method of one's own, and the file that `bench-suite board` tries."""

from typing import TYPE_CHECKING

from reconstruction._src.base.lazy import export_lazily

if TYPE_CHECKING:
    from evolution._src.suite.submission import Entry, Submission, fill_submission, load_submission
    from evolution._src.suite.tasks import BUDGET, SEEDS, SUITE, SuiteTask, find_suite_task

__all__ = [
    "BUDGET",
    "SEEDS",
    "SUITE",
    "Entry",
    "Submission",
    "SuiteTask",
    "fill_submission",
    "find_suite_task",
    "load_submission",
]

__getattr__, __dir__ = export_lazily(__name__)
