"""Cheaper trials change the samples of a search only, and never make a spared genotype the fitter one."""

from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.cheap_trials import summarize
from benchmarks.material import cheap_trials
from evolution._src.backends.outcome import Outcome
from evolution._src.backends.trials import Job, Trials
from evolution._src.search.record import SAMPLE, VALIDATION


def pretend(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Return the first gene as progress; above 1 it is a success."""
    return [
        Outcome(
            float(job.genotype[0]),
            0.0,
            (bool(job.genotype[0] > 1),) * job.trials.count,
            2.0 * job.trials.count,
        )
        for job in jobs
    ]


@pytest.fixture(autouse=True)
def no_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the first gene for the outcome."""
    monkeypatch.setattr(cheap_trials, "simulate", pretend)


def make_jobs(values: Sequence[float], kind: int = SAMPLE) -> list[Job]:
    """Return jobs of three trials each."""
    return [Job(np.array([value]), Trials(count=3, seed=(0, kind, 0))) for value in values]


def test_racing_tries_the_worse_half_once():
    """Two of four are tried in full; the others fail in the trials that they did not get."""
    racing = cheap_trials.WAYS["racing"]()
    outcomes = racing(make_jobs([0.1, 2.0, 0.2, 0.5]), 1)
    assert [outcome.trials for outcome in outcomes] == [3, 3, 3, 3]
    assert [outcome.seconds for outcome in outcomes] == [2.0, 6.0, 2.0, 6.0]
    assert [outcome.successes for outcome in outcomes] == [0, 3, 0, 0]
    assert racing.tried.spared == 2
    assert racing.tried.seconds == 16.0


@pytest.mark.parametrize("way", cheap_trials.WAYS)
def test_candidates_are_tried_in_full(way: str):
    """Trials of candidates are those of the search as it is."""
    jobs = make_jobs([0.1, 2.0, 0.2, 0.5], VALIDATION)
    tries = cheap_trials.WAYS[way]()
    assert tries(jobs, 1) == pretend(jobs, 1)
    assert tries.tried.genotypes == 0


def test_surrogate_tries_the_half_that_promises_more():
    """Once 48 outcomes are known it prefers higher genes, and none that it spared is fitter than one it tried."""
    surrogate = cheap_trials.WAYS["surrogate"]()
    known = np.linspace(-1, 1, 48)
    assert len(surrogate(make_jobs(known.tolist()), 1)) == 48
    outcomes = surrogate(make_jobs([-0.9, 0.9, -0.5, 0.5]), 1)
    assert [outcome.seconds > 0 for outcome in outcomes] == [False, True, False, True]
    assert max(outcomes[0].progress, outcomes[2].progress) <= 0.5
    assert surrogate.tried.spared == 2


def test_summary_is_the_median_of_ratios_by_seed():
    """Ratios are those of equal seeds."""
    rows = [
        {"way": way, "seed": seed, "cpu_seconds": seconds, "confirmed": True, "held_in_truth": held}
        for way, seed, seconds, held in (
            ("full", 0, 10.0, 20),
            ("full", 1, 40.0, 20),
            ("racing", 0, 5.0, 17),
            ("racing", 1, 10.0, 18),
        )
    ]
    found = summarize(rows)["racing"]
    assert found["times_faster"] == 3.0
    assert (found["held"], found["confirmed"], found["seeds"]) == (1, 2, 2)
