"""The benchmark suite on made physics: rules of tasks, baselines, files, verification and the ranking."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evolution._src.backends.scoring import Outcome
from evolution._src.cli.command import UsageError
from evolution._src.cli.commands.bench_suite import BenchSuite
from evolution._src.errors import RunError
from evolution._src.suite import running
from evolution._src.suite import submission as submission_module
from evolution._src.suite import tasks as tasks_module
from evolution._src.suite.leaderboard import SHARED, count_wins, find_overview, make_page, rank
from evolution._src.suite.running import run_suite
from evolution._src.suite.submission import Score, Submission, load_submission
from evolution._src.suite.tasks import (
    EXAM_TRIALS,
    GAP,
    SUITE,
    find_published_arena,
    find_suite_task,
    make_true_arena,
)
from symbrion_gym._src.arenas.arena import Arena

SUBMISSIONS = Path(__file__).parents[3] / "benchmarks" / "submissions"
FIXED, FREE = "gap, 4 in a row", "gap, any body"


def simulate(jobs, threads):
    """The nearer the genes to 0.3 the farther; trials take 5 s; the truth is a little harder."""
    outcomes = []
    for job in jobs:
        is_true = not isinstance(job.trials.arena, str) or job.trials.arena == "truth"
        progress = 1.0 - float(np.abs(job.genotype - 0.3).mean()) - 0.1 * is_true
        successes = (bool(progress > 0.8),) * job.trials.count
        outcomes.append(Outcome(progress, 0.0, successes, seconds=5.0 * job.trials.count))
    return outcomes


@pytest.fixture(autouse=True)
def _use_made_physics(monkeypatch):
    make = submission_module.make_backend
    monkeypatch.setattr(submission_module, "make_backend", lambda *args: make(*args, simulate=simulate))
    monkeypatch.setattr(tasks_module, "find_published_arena", lambda name: name)


def run(method, seeds=(0,), tasks=(FIXED, FREE)):
    return run_suite(method, seeds, tasks, budget=400.0, simulate=simulate)


def test_the_suite_has_8_to_12_tasks_with_names_of_their_own():
    assert 8 <= len(SUITE) <= 12
    assert len({task.name for task in SUITE}) == len(SUITE)
    with pytest.raises(RunError, match="no task 'moon'"):
        find_suite_task("moon")


def test_learning_beats_chance_and_chance_beats_nothing():
    fitness = {
        name: np.mean([each.truth.fitness for each in run(name, seeds=(0, 1), tasks=(FIXED,)).entries])
        for name in ("zero", "random", "cmaes")
    }
    assert fitness["cmaes"] > fitness["random"]
    assert fitness["cmaes"] > fitness["zero"] == pytest.approx(0.6)


def test_every_task_has_a_scan_that_ships_and_an_exact_counterpart():
    for task in SUITE:
        if task.truth is None:
            folder = find_published_arena(task.arena)
            scan, exact = Arena.load(folder), make_true_arena(task.arena)
            assert scan.course is None  # nothing of the truth is in the scan
            np.testing.assert_allclose(scan.surface.bounds, exact.surface.bounds, atol=0.3)
    gap = find_published_arena("gap")
    assert sum(path.stat().st_size for path in gap.rglob("*") if path.is_file()) < 300_000
    assert make_true_arena("gap").course == GAP
    assert GAP.pit == 0.25
    assert sum(task.body is None for task in SUITE) >= 3


def test_a_submission_is_read_as_written_and_verified(tmp_path):
    found = run("cmaes")
    found.save(tmp_path / "a.json")
    read = load_submission(tmp_path / "a.json")
    assert read.entries == found.entries
    assert all(check.holds for check in running.verify(read))


def test_a_score_that_was_raised_is_found_out(tmp_path):
    found = run("cmaes", tasks=(FIXED,))
    entry = found.entries[0]
    raised = replace(entry, truth=Score(entry.truth.fitness + 0.01, entry.truth.successes))
    more = replace(entry, scan=Score(entry.scan.fitness, (entry.scan.successes + 1) % EXAM_TRIALS))
    checks = running.verify(Submission("raised", (entry, raised, more)))
    assert [check.holds for check in checks] == [True, False, False]
    both = Submission("both", (entry, run("zero", tasks=(FREE,)).entries[0]))
    assert [check.entry.task for check in running.verify(both, tasks=(FREE,))] == [FREE]
    with pytest.raises(RunError, match="no task 'moon'"):
        running.verify(both, tasks=("moon",))
    Submission("raised", (raised,)).save(tmp_path / "raised.json")
    from evolution._src.cli.console import Console

    summary = BenchSuite(action="verify", files=(tmp_path / "raised.json",), quiet=True).run(
        Console(True, True)
    )
    assert (summary["ok"], summary["failed"]) == (False, 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body": "SF0F0000"}, "the task gives"),
        ({"genotype": (float("nan"),)}, "not finite"),
        ({"seconds": 1e5}, "were spent"),
        ({"task": "moon"}, "no task 'moon'"),
        ({"task": FREE, "body": "snake8"}, "at most 5"),
    ],
)
def test_entries_that_break_a_rule_are_refused(changes, message):
    entry = run("zero", tasks=(FIXED,)).entries[0]
    with pytest.raises(RunError, match=message):
        Submission("broken", (replace(entry, **changes),))


def test_files_that_are_no_submission_are_refused(tmp_path):
    path = tmp_path / "a.json"
    with pytest.raises(RunError, match="cannot be read"):
        load_submission(path)
    run("zero", tasks=(FIXED,)).save(path)
    content = json.loads(path.read_text())
    for change in ({"format": "other"}, {"version": "0"}, {"entries": [{"task": FIXED}]}):
        path.write_text(json.dumps(content | change))
        with pytest.raises(RunError, match=r"no submission|of suite '0'|cannot be read"):
            load_submission(path)


def test_the_ranking_is_by_successes_in_the_truth(tmp_path):
    entry = run("zero", tasks=(FIXED,)).entries[0]
    low = Submission("low", (replace(entry, truth=Score(9.0, 1)),))
    high = Submission("high", (replace(entry, truth=Score(0.5, 9)),))
    rows = rank([low, high])
    assert [row.submission for row in rows] == ["high", "low"]
    assert count_wins([low, high]) == {"low": 0, "high": 1}
    low.save(tmp_path / "low.json")
    from evolution._src.cli.console import Console

    BenchSuite(action="board", files=(tmp_path / "low.json",), out=tmp_path / "b.html").run(
        Console(True, True)
    )
    assert "low" in (tmp_path / "b.html").read_text()


def test_rows_have_mean_and_deviation_over_seeds_and_the_overview_says_what_is_missing():
    entry = run("zero", tasks=(FIXED,)).entries[0]
    entries = tuple(
        replace(entry, seed=seed, truth=Score(fitness, successes), seconds=1000.0 + seed)
        for seed, (fitness, successes) in enumerate(((1.0, 2), (2.0, 6)))
    )
    row = rank([Submission("two", entries)])[0]
    assert row.seeds == 2
    assert row.truth_successes == pytest.approx((4.0, 8.0**0.5))
    both = Submission("both", (entry, replace(run("zero", tasks=(FREE,)).entries[0])))
    overview = find_overview([Submission("two", entries), both])
    assert [line[:6] for line in overview] == [
        ["both", "0.0", "2", "1", "0", "0"],
        ["two", "4.0", "1", "2", "1", "0"],
    ]
    uneven = Submission("uneven", (*entries, both.entries[1]))
    assert find_overview([uneven])[0][3] == "1-2"
    assert overview[1].count("–") == len(SUITE) - 1


def test_ties_are_ties_and_nobody_leads_without_a_success(tmp_path):
    entry = run("zero", tasks=(FIXED,)).entries[0]
    scores = {"a": (0.3, 0), "b": (0.2, 7), "c": (0.9, 7), "d": (0.1, 4)}
    boards = [Submission(name, (replace(entry, truth=Score(*score)),)) for name, score in scores.items()]
    assert [(row.submission, row.place) for row in rank(boards)] == [
        *(("c", "1="), ("b", "1="), ("d", "3"), ("a", "–")),
    ]
    assert count_wins(boards) == dict.fromkeys(scores, 0)
    assert count_wins(boards, SHARED) == {"a": 0, "b": 1, "c": 1, "d": 0}
    alone = [each for each in boards if each.name in "ad"]
    assert count_wins(alone) == {"a": 0, "d": 1}
    failed = [replace(boards[0], name=name) for name in "xyz"]
    assert {row.place for row in rank(failed)} == {"–"}
    assert {tuple(line[4:6]) for line in find_overview(failed)} == {("0", "0")}
    make_page(boards).write(tmp_path / "board.html")
    html = (tmp_path / "board.html").read_text()
    assert html.count('<div class="scroll"><table>') == html.count("<table>") == 2


@pytest.mark.parametrize(
    "options",
    [
        {"action": "verify"},
        {"action": "run"},
        {"action": "board"},
        {"action": "run", "out": "a.html"},
        {"action": "list", "files": ("a.json",)},
        {"action": "verify", "files": ("missing.json",)},
        {"action": "list", "seeds": (-1,)},
        {"action": "list", "budget": 0.0},
    ],
)
def test_command_lines_that_cannot_be_executed_are_refused(options, tmp_path):
    from pathlib import Path

    given = dict(options)
    if "out" in given:
        given["out"] = tmp_path / given["out"]
    given["files"] = tuple(Path(each) for each in given.get("files", ()))
    with pytest.raises(UsageError):
        BenchSuite(**given)


@pytest.mark.skipif(not SUBMISSIONS.is_dir(), reason="a wheel has no submissions")
def test_submissions_that_ship_keep_the_rules_and_name_their_origin():
    files = sorted(SUBMISSIONS.glob("*.json"))
    assert files
    for file in files:
        submission = load_submission(file)
        assert submission.provenance["commit"]
        assert not submission.provenance["dirty"]
        assert all(entry.task in {task.name for task in SUITE} for entry in submission.entries)
