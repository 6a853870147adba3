"""The leaderboard: the scores of submissions side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evolution.suite.submission import Submission
from evolution.suite.tasks import BUDGET, EXAM_TRIALS, SUITE, VERSION

COLUMNS = ("task", "submission", "seeds", "successes in truth [%]", "fitness in truth", "fitness on the scan")


def rank(submissions: Sequence[Submission]) -> list[list[Any]]:
    """Return a row for each task and submission, ordered by success rate in the truth, then fitness there."""
    rows = []
    for task in SUITE:
        own = []
        for submission in submissions:
            entries = [entry for entry in submission.entries if entry.task == task.name]
            if not entries:
                continue
            rate = 100 * float(np.mean([entry.truth.successes for entry in entries])) / EXAM_TRIALS
            truth, scan = (
                float(np.mean([getattr(entry, kind).fitness for entry in entries]))
                for kind in ("truth", "scan")
            )
            own.append([task.name, submission.name, len(entries), rate, truth, scan])
        rows += sorted(own, key=lambda row: (-row[3], -row[4], row[1]))
    return rows


def count_wins(submissions: Sequence[Submission]) -> dict[str, int]:
    """Return of how many tasks each submission leads the ranking."""
    wins = dict.fromkeys((submission.name for submission in submissions), 0)
    seen = set()
    for task, name, *_ in rank(submissions):
        if task not in seen:
            wins[name] += 1
            seen.add(task)
    return wins


def format_rows(rows: Sequence[Sequence[Any]]) -> list[list[str]]:
    """Return the rows as text."""
    return [[row[0], row[1], str(row[2]), f"{row[3]:.0f}", f"{row[4]:.2f}", f"{row[5]:.2f}"] for row in rows]


def make_page(submissions: Sequence[Submission]) -> Any:
    """Return the leaderboard as a page."""
    from evolution.report.page import Page

    page = Page(
        title=f"Symbrion benchmark suite {VERSION}",
        summary=(
            f"{len(SUITE)} tasks, {BUDGET:.0f} simulated seconds for a task and seed. A method sees the scanned arena "
            f"alone; a score is the mean of {EXAM_TRIALS} trials under other conditions, on the scan and in the truth."
        ),
    )
    page.add_section("Tasks led")
    wins = count_wins(submissions)
    page.add_table(
        ["submission", "tasks led"],
        [[name, str(number)] for name, number in sorted(wins.items(), key=lambda each: -each[1])],
        "Ranked by successes in the truth, then by fitness there.",
    )
    page.add_section("Scores")
    page.add_table(list(COLUMNS), format_rows(rank(submissions)), "Means over seeds.")
    page.add_section("Provenance")
    page.add_list([f"{each.name}: {dict(each.provenance)}" for each in submissions])
    return page
