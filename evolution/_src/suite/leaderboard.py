"""The leaderboard: the scores of submissions side by side."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from evolution._src.suite.submission import Entry, Submission
from evolution._src.suite.tasks import BUDGET, EXAM_TRIALS, SUITE, VERSION

SHORT_COLUMNS = ("task", "submission", "place", "seeds", "truth", "scan", "fitness")
"""Those that a terminal has room for; the fitness is that in the truth."""
_SHORT_COMMIT = 8
ALONE, SHARED, NOWHERE = "1", "1=", "–"
"""Places: the first, the first with others, and that of submissions without any success."""


class Spread(NamedTuple):
    """A number over the seeds."""

    mean: float  # its mean
    deviation: float  # its standard deviation over seeds; nan with one seed

    def format(self, digits: int) -> str:
        """Return "mean ± deviation", or the mean of the only seed."""
        if np.isnan(self.deviation):
            return f"{self.mean:.{digits}f}"
        return f"{self.mean:.{digits}f} ± {self.deviation:.{digits}f}"


class Row(NamedTuple):
    """What a submission has on a task."""

    task: str  # name of the task
    submission: str  # name of the submission
    seeds: int  # how many there are
    truth_successes: Spread  # of `EXAM_TRIALS`, in the truth
    scan_successes: Spread  # on the scan
    truth_fitness: Spread  # in the truth
    scan_fitness: Spread  # on the scan
    seconds: float  # simulated for it, mean [s]
    # by mean successes in the truth: "1", "2=" where several have as many, and "–" without any success
    place: str = NOWHERE


def rank(submissions: Sequence[Submission]) -> list[Row]:
    """Return a row for each task and submission, ordered by successes in the truth, then fitness there.

    The place of a row is by successes alone: who succeeds as often as another is tied with it.
    """
    rows = []
    for task in SUITE:
        own = []
        for submission in submissions:
            entries = [entry for entry in submission.entries if entry.task == task.name]
            if entries:
                own.append(_sum_up(submission.name, entries))
        means = [row.truth_successes.mean for row in own]
        own = [row._replace(place=_find_place(row.truth_successes.mean, means)) for row in own]
        rows += sorted(
            own, key=lambda row: (-row.truth_successes.mean, -row.truth_fitness.mean, row.submission)
        )
    return rows


def _find_place(mean: float, means: Sequence[float]) -> str:
    if mean <= 0.0:
        return NOWHERE
    return f"{1 + sum(each > mean for each in means)}{'=' * (means.count(mean) > 1)}"


def count_wins(submissions: Sequence[Submission], place: str = ALONE) -> dict[str, int]:
    """Return on how many tasks each submission has a place: alone at the top, or `SHARED` with others."""
    wins = dict.fromkeys((submission.name for submission in submissions), 0)
    for row in rank(submissions):
        wins[row.submission] += row.place == place
    return wins


def find_overview(submissions: Sequence[Submission]) -> list[list[str]]:
    """Return a row for each submission: mean successes in the truth, tasks, seeds, tasks led, tied, then each task.

    The best mean first; a submission that has not all tasks comes after those that have, and "–" stands where it has
    none.
    """
    wins, ties = count_wins(submissions), count_wins(submissions, SHARED)
    table = {(row.task, row.submission): row for row in rank(submissions)}
    lines = []
    for name in wins:
        cells = [table.get((task.name, name)) for task in SUITE]
        own = [cell.truth_successes.mean for cell in cells if cell]
        mean = float(np.mean(own)) if own else 0.0
        shown = [f"{cell.truth_successes.mean:.1f}" if cell else "–" for cell in cells]
        seeds = sorted({cell.seeds for cell in cells if cell})
        counts = [str(len(own)), "-".join(map(str, seeds[:: max(len(seeds) - 1, 1)]))]
        counts += [str(wins[name]), str(ties[name])]
        lines.append((-len(own), -mean, name, [name, f"{mean:.1f}", *counts, *shown]))
    return [line[-1] for line in sorted(lines)]


def shorten_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return the rows as text for a terminal, the name of a task in the first of its rows alone."""
    lines = []
    for task, own in groupby(rows, key=lambda row: row.task):
        for index, row in enumerate(own):
            lines.append([task if index == 0 else "", *_format_row(row)[: len(SHORT_COLUMNS) - 1]])
    return lines


def make_page(submissions: Sequence[Submission]) -> Any:
    """Return the leaderboard as a page."""
    from evolution._src.report.page import Page

    page = Page(
        title=f"Symbrion benchmark suite {VERSION}",
        summary=(
            f"{len(SUITE)} tasks, {BUDGET:,.0f} simulated seconds for a task and seed. A method sees the scanned arena "
            f"alone; a score is {EXAM_TRIALS} trials under other conditions, on the scan and in the truth."
        ),
    )
    page.add_section("Overview")
    page.add_table(
        ["submission", "mean", "tasks", "seeds", "led", "tied", *(task.name for task in SUITE)],
        find_overview(submissions),
        f"Successes of {EXAM_TRIALS} in the truth, mean over seeds and its tasks; how many tasks and seeds it has; "
        "tasks led by more successes than all others, and tied for the lead; then each task. Nobody leads where nobody "
        "succeeds.",
    )
    for name, rows in groupby(rank(submissions), key=lambda row: row.task):
        page.add_section(name.capitalize())
        page.add_table(
            [
                *("submission", "place", "seeds", f"truth, of {EXAM_TRIALS}", f"scan, of {EXAM_TRIALS}"),
                *("fitness, truth", "fitness, scan", "spent [s]"),
            ],
            [_format_row(row) for row in rows],
            "Successes and fitness, mean ± standard deviation over seeds. The place is by successes in the truth: 1= "
            "is a tie for the first, – has no success. Rows of one place are ordered by fitness in the truth.",
        )
    page.add_section("Provenance")
    page.add_list([_describe(each) for each in submissions])
    return page


def _sum_up(name: str, entries: Sequence[Entry]) -> Row:
    scores = [
        (entry.truth.successes, entry.scan.successes, entry.truth.fitness, entry.scan.fitness)
        for entry in entries
    ]
    means = np.mean(scores, axis=0).tolist()
    deviations = np.std(scores, axis=0, ddof=1).tolist() if len(entries) > 1 else [np.nan] * len(means)
    truth, scan, truth_fitness, scan_fitness = map(Spread, means, deviations)
    seconds = float(np.mean([entry.seconds for entry in entries]))
    return Row(entries[0].task, name, len(entries), truth, scan, truth_fitness, scan_fitness, seconds)


def _format_row(row: Row) -> list[str]:
    successes = [each.format(1) for each in (row.truth_successes, row.scan_successes)]
    fitness = [each.format(2) for each in (row.truth_fitness, row.scan_fitness)]
    return [row.submission, row.place, str(row.seeds), *successes, *fitness, f"{row.seconds:.0f}"]


def _describe(submission: Submission) -> str:
    """Return in one line where a submission comes from."""
    known = dict(submission.provenance)
    commit, versions = known.pop("commit", None), known.pop("versions", {})
    is_dirty = known.pop("dirty", False)
    words = [f"commit {commit[:_SHORT_COMMIT]}" if commit else "no commit"]
    words += ["with changes that are not committed"] * bool(is_dirty)
    words += [f"{name} {value}" for name, value in {**versions, **known}.items() if name != "method"]
    return f"{submission.name} (suite {submission.version}): {', '.join(words)}"
