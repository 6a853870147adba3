"""The leaderboard: what submissions reached in an exam, side by side."""

from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from evolution._src.suite.exam import LONGEST_LINE, TRIALS, Exam, Result
from evolution._src.suite.submission import Submission
from evolution._src.suite.tasks import BUDGET, SEEDS, SUITE, VERSION
from reconstruction._src.base.printable import make_printable

COLUMNS = ("submission", "place", "seeds", "truth", "scan", "fitness", "spent [s]")
"""Of a task: place, successes with their interval, fitness in the truth, and simulated time spent."""
_TRIMMED = 0.25  # Share left out at each end by the interquartile mean


class Estimate(NamedTuple):
    """A number over the seeds: its interquartile mean, and the 95 % interval of that by bootstrap.

    References:
        Agarwal et al. (2021), "Deep reinforcement learning at the edge of the statistical precipice", section 4.
    """

    mean: float
    low: float  # the mean itself where there is one seed alone
    high: float

    def __str__(self) -> str:
        """Return "mean (low-high)", or the mean where nothing differs."""
        interval = f" ({self.low:.1f}-{self.high:.1f})" if self.low < self.high else ""
        return f"{self.mean:.1f}{interval}"


class Row(NamedTuple):
    """What a submission has on a task."""

    task: str  # name of the task
    submission: str  # name of the submission
    place: str  # by successes in the truth: "1", "2=" of ties; "–" without any success, or without all seeds
    seeds: int  # how many there are; equal genes count once
    truth: Estimate  # successes in the truth, of `TRIALS`
    scan: Estimate  # successes on the scan, of `TRIALS`
    fitness: float  # in the truth, mean
    seconds: float  # simulated for it, mean [s]

    def format(self) -> list[str]:
        """Return the text of `COLUMNS`."""
        numbers = [f"{self.fitness:.2f}", f"{self.seconds:.0f}"]
        return [self.submission, self.place, str(self.seeds), str(self.truth), str(self.scan), *numbers]


def rank(exam: Exam) -> list[Row]:
    """Return a row for each task and submission, ordered by successes in the truth, then fitness there."""
    rows = []
    for task in SUITE:
        results = sorted(
            (each for each in exam.results if each.entry.task == task.name), key=lambda each: each.submission
        )
        own = [_sum_up(list(each)) for _, each in groupby(results, key=lambda each: each.submission)]
        means = [row.truth.mean for row in own if row.seeds == len(SEEDS)]
        own = [row._replace(place=_find_place(row, means)) for row in own]
        rows += sorted(own, key=lambda row: (-row.truth.mean, -row.fitness, row.submission))
    return rows


def _sum_up(results: Sequence[Result]) -> Row:
    first = results[0]
    truth, scan = (
        estimate([getattr(each, name).successes for each in results]) for name in ("truth", "scan")
    )
    fitness, seconds = np.mean(
        [(each.truth.fitness, each.entry.seconds) for each in results], axis=0
    ).tolist()
    seeds = len({(each.entry.controller, each.entry.genotype) for each in results})
    return Row(first.entry.task, first.submission, "–", seeds, truth, scan, fitness, seconds)


def estimate(values: Sequence[float]) -> Estimate:
    """Return what values over seeds show."""
    mean = float(stats.trim_mean(values, _TRIMMED))
    if np.ptp(values) == 0:
        return Estimate(mean, mean, mean)
    found = stats.bootstrap(
        (values,), lambda each, axis: stats.trim_mean(each, _TRIMMED, axis), method="percentile", rng=0
    )
    return Estimate(mean, *map(float, found.confidence_interval))


def _find_place(row: Row, means: Sequence[float]) -> str:
    if row.truth.mean <= 0.0 or row.seeds < len(SEEDS):
        return "–"
    return f"{1 + sum(each > row.truth.mean for each in means)}{'=' * (means.count(row.truth.mean) > 1)}"


def make_page(exam: Exam, submissions: Sequence[Submission]) -> Any:
    """Return the leaderboard as a page."""
    from evolution._src.report.page import Page

    page = Page(
        title=f"Symbrion benchmark suite {VERSION}",
        summary=(
            f"{len(SUITE)} tasks, {BUDGET:,.0f} simulated seconds for a task and seed. Every entry was tried again: "
            f"{TRIALS} trials on a scan and in the truth, both drawn with exam seed {exam.seed}. "
            "Shown are successes, the interquartile mean over seeds with its 95 % interval; "
            "the place is by those in the truth: 1= is a tie, – has no success, or not all seeds (equal genes are one)."
        ),
    )
    for name, rows in groupby(rank(exam), key=lambda row: row.task):
        page.add_section(name.capitalize())
        page.add_table(
            list(COLUMNS), [row.format() for row in rows], f"Successes of {TRIALS}; fitness in the truth."
        )
    if exam.untried:
        page.add_section("Not tried, so not ranked")
        page.add_list([f"{name}: {why}" for name, why in exam.untried])
    page.add_section("Provenance, as submissions tell it")
    page.add_list([_describe(each) for each in submissions])
    return page


def _describe(submission: Submission) -> str:
    """Return in one line where a submission comes from."""
    known = dict(submission.provenance)
    versions = known.pop("versions", None)
    told = {**(versions if isinstance(versions, dict) else {}), **known}
    words = [f"{name} {value}" for name, value in told.items() if name != "method"]
    return make_printable(f"{submission.name} (suite {submission.version}): {', '.join(words)}", LONGEST_LINE)
