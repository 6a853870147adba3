"""The benchmark suite on made physics: rules of tasks, baselines, files, verification and the ranking."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evolution._src.backends.cluster import make_backend
from evolution._src.backends.scoring import Outcome
from evolution._src.cli.command import UsageError
from evolution._src.cli.commands.bench_suite import METHODS as NAMES
from evolution._src.cli.commands.bench_suite import BenchSuite
from evolution._src.cli.console import Console
from evolution._src.errors import RunError
from evolution._src.suite import baselines
from evolution._src.suite import submission as submission_module
from evolution._src.suite import tasks as tasks_module
from evolution._src.suite.baselines import METHODS, Practice, run_baseline, run_suite
from evolution._src.suite.leaderboard import SHARED, count_wins, find_overview, make_page, rank
from evolution._src.suite.submission import Entry, Score, Submission, fill_submission, load_submission, verify
from evolution._src.suite.tasks import (
    EXAM_SEED,
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
BUDGET = 400.0


def simulate(jobs, threads):
    """The nearer the genes to 0.3 and the more modules the farther; trials take 5 s; the truth is a little harder."""
    outcomes = []
    for job in jobs:
        trials = job.trials
        is_true = not isinstance(trials.arena, str) or trials.arena == "truth"
        progress = 1.0 - float(np.abs(job.genotype - 0.3).mean()) + 0.1 * trials.find_organism().num_modules
        progress -= 0.1 * is_true
        effort, successes = float(abs(job.genotype[-1])) / 10.0, (progress > 1.2,) * trials.count
        outcomes.append(Outcome(progress, effort, successes, seconds=5.0 * trials.count))
    return outcomes


@pytest.fixture(autouse=True)
def _use_made_physics(monkeypatch):
    make = submission_module.make_backend
    monkeypatch.setattr(submission_module, "make_backend", lambda *args: make(*args, simulate=simulate))
    monkeypatch.setattr(tasks_module, "find_published_arena", lambda name: name)


def run(method, seeds=(0,), tasks=(FIXED, FREE), **options):
    chosen = (FREE,) if method == "surrogate" else tasks
    return run_suite(method, seeds, chosen, BUDGET, simulate=simulate, **options)


@pytest.fixture
def entry():
    return run("zero", tasks=(FIXED,)).entries[0]


def test_the_suite_has_tasks_and_the_command_every_baseline():
    assert len({task.name for task in SUITE}) == len(SUITE) == 8
    assert sum(task.body is None for task in SUITE) >= 3
    assert NAMES.__args__ == tuple(METHODS)


def test_every_task_has_a_scan_that_ships_and_an_exact_counterpart():
    for task in SUITE:
        if task.truth is None:
            scan, exact = Arena.load(find_published_arena(task.arena)), make_true_arena(task.arena)
            assert scan.course is None  # nothing of the truth is in the scan
            np.testing.assert_allclose(scan.surface.bounds, exact.surface.bounds, atol=0.3)
    gap = find_published_arena("gap")
    assert sum(path.stat().st_size for path in gap.rglob("*") if path.is_file()) < 300_000
    assert make_true_arena("gap").course == GAP


@pytest.mark.parametrize("method", METHODS)
def test_equal_seeds_give_equal_bits_at_any_number_of_workers_and_learning_beats_nothing(method):
    entries = run(method).entries
    assert run(method, workers=3).entries == entries
    if method == "zero":
        return
    other = run(method, seeds=(1,)).entries[-1]
    assert (other.body, other.genotype) != (entries[-1].body, entries[-1].genotype)
    zero = {entry.task: entry.truth.fitness for entry in run("zero").entries}
    for entry in entries:
        # A generation that has begun is finished.
        assert BUDGET <= entry.seconds <= BUDGET + (200.0 if entry.task == FREE else 40.0)
        assert method == "random" or entry.truth.fitness > zero[entry.task]


def test_the_surrogate_search_finds_large_bodies_where_these_are_better():
    assert run("surrogate").entries[-1].truth.fitness > run("random").entries[-1].truth.fitness


def test_practice_keeps_the_best_counts_time_and_has_no_seed_of_the_exam():
    """NumPy pads seeds with zeros: a generation 0 would have that of the exam's first trial."""
    asked = []

    def watch(jobs, threads):
        asked.extend(job.trials.seed for job in jobs)
        return simulate(jobs, threads)

    task = find_suite_task(FIXED)
    practice = Practice(task, make_backend("batch", 1, simulate=watch), 12.0)
    body = task.make_trials(task.body, "oscillators", 1, (0,)).find_organism()
    genes = len(practice.make_controller(body).parameters)
    fitness = practice.try_all(body, np.array([np.zeros(genes), np.full(genes, 0.3)]))
    assert (practice.seconds, practice.generation, practice.has_time()) == (10.0, 1, True)
    assert fitness[1] == pytest.approx(1.4 + 1.0 - 0.2 * 0.03)
    practice.try_all(body, np.zeros((1, genes)))
    assert not practice.has_time()
    assert practice.best is not None
    np.testing.assert_array_equal(practice.best.genotype, np.full(genes, 0.3))
    learned = {int(np.random.SeedSequence(list(seed)).generate_state(1)[0]) for seed in asked}
    exam = set(np.random.SeedSequence(list(EXAM_SEED)).generate_state(EXAM_TRIALS).tolist())
    assert len(learned) == 2
    assert not learned & exam


def test_what_does_not_exist_or_suit_is_refused():
    with pytest.raises(RunError, match="no task 'moon'"):
        find_suite_task("moon")
    with pytest.raises(RunError, match="method"):
        run_suite("moon", (0,), simulate=simulate)
    with pytest.raises(RunError, match="searches bodies"):
        run_baseline("surrogate", find_suite_task(FIXED), 0, make_backend("batch", 1, simulate=simulate))


def test_a_run_that_was_stopped_goes_on_and_computes_no_entry_again(tmp_path, entry):
    out, calls = tmp_path / "a.json", []
    whole = run("random", seeds=(0, 1), out=tmp_path / "whole.json")
    run("random", seeds=(0,), out=out)
    assert run("random", seeds=(0, 1), out=out).entries == whole.entries == load_submission(out).entries

    def find_entry(task, seed):
        calls.append(seed)
        if seed == 2 and len(calls) == 3:
            raise KeyboardInterrupt
        return Entry(task.name, seed, entry.body, "oscillators", (0.0,), 1.0, Score(0.0, 0), Score(0.0, 0))

    pairs = [(find_suite_task(FIXED), seed) for seed in (0, 1, 2)]
    with pytest.raises(KeyboardInterrupt):
        fill_submission("mine", find_entry, pairs, {"method": "mine"}, tmp_path / "b.json")
    done = fill_submission("mine", find_entry, pairs, {"method": "mine"}, tmp_path / "b.json")
    assert calls == [0, 1, 2, 2]
    assert [each.seed for each in done.entries] == [0, 1, 2]


def test_a_file_of_another_run_is_not_continued(tmp_path, monkeypatch):
    run("random", out=tmp_path / "a.json")
    with pytest.raises(RunError, match="differs in: method"):
        run("cmaes", out=tmp_path / "a.json")
    monkeypatch.setattr(baselines, "describe_origin", lambda: {"commit": "another"})
    with pytest.raises(RunError, match="name another file"):
        run("random", out=tmp_path / "a.json")


def test_a_submission_is_read_as_written_and_a_score_that_was_raised_is_found_out(tmp_path):
    found = run("cmaes")
    found.save(tmp_path / "a.json")
    read = load_submission(tmp_path / "a.json")
    assert read.entries == found.entries
    assert all(check.holds for check in verify(read))
    entry = found.entries[0]
    raised = replace(entry, truth=Score(entry.truth.fitness + 0.01, entry.truth.successes))
    more = replace(entry, scan=Score(entry.scan.fitness, (entry.scan.successes + 1) % EXAM_TRIALS))
    checks = verify(Submission("raised", (entry, raised, more)))
    assert [check.holds for check in checks] == [True, False, False]
    assert [check.entry.task for check in verify(found, tasks=(FREE,))] == [FREE]
    with pytest.raises(RunError, match="no task 'moon'"):
        verify(found, tasks=("moon",))
    Submission("raised", (raised,)).save(tmp_path / "raised.json")
    command = BenchSuite(action="verify", files=(tmp_path / "raised.json",), quiet=True)
    summary = command.run(Console(True, True))
    assert (summary["ok"], summary["failed"]) == (False, 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body": "SF0F0000"}, "the task gives"),
        ({"genotype": (float("nan"),)}, "not finite"),
        ({"seconds": 1e5}, "were spent"),
        ({"task": "moon"}, "no task 'moon'"),
        ({"task": FREE, "body": "snake8"}, "at most 5"),
        ({"task": FREE, "body": "SBSB0000"}, "join the arm"),
    ],
)
def test_entries_that_break_a_rule_are_refused(entry, changes, message):
    with pytest.raises(RunError, match=message):
        Submission("broken", (replace(entry, **changes),))


def test_files_that_are_no_submission_are_refused(tmp_path, entry):
    path = tmp_path / "a.json"
    with pytest.raises(RunError, match="cannot be read"):
        load_submission(path)
    Submission("zero", (entry,)).save(path)
    content = json.loads(path.read_text())
    for change in ({"format": "other"}, {"version": "0"}, {"entries": [{"task": FIXED}]}):
        path.write_text(json.dumps(content | change))
        with pytest.raises(RunError, match=r"no submission|of suite '0'|cannot be read"):
            load_submission(path)


def test_rows_have_mean_and_deviation_over_seeds_and_the_overview_says_what_is_missing(entry):
    entries = tuple(
        replace(entry, seed=seed, truth=Score(fitness, successes), seconds=1000.0 + seed)
        for seed, (fitness, successes) in enumerate(((1.0, 2), (2.0, 6)))
    )
    row = rank([Submission("two", entries)])[0]
    assert (row.seeds, row.seconds) == (2, 1000.5)
    assert row.truth_successes == pytest.approx((4.0, 8.0**0.5))
    both = Submission("both", (entry, run("zero", tasks=(FREE,)).entries[0]))
    overview = find_overview([Submission("two", entries), both])
    assert [line[:6] for line in overview] == [
        ["both", "0.0", "2", "1", "0", "0"],
        ["two", "4.0", "1", "2", "1", "0"],
    ]
    assert find_overview([Submission("uneven", (*entries, both.entries[1]))])[0][3] == "1-2"
    assert overview[1].count("–") == len(SUITE) - 1


def test_the_ranking_is_by_successes_in_the_truth_with_ties_and_nobody_leads_without_one(tmp_path, entry):
    scores = {"a": (0.3, 0), "b": (0.2, 7), "c": (0.9, 7), "d": (0.1, 4)}
    boards = [Submission(name, (replace(entry, truth=Score(*score)),)) for name, score in scores.items()]
    assert [(row.submission, row.place) for row in rank(boards)] == [
        *(("c", "1="), ("b", "1="), ("d", "3"), ("a", "–"))
    ]
    assert count_wins(boards) == dict.fromkeys(scores, 0)
    assert count_wins(boards, SHARED) == {"a": 0, "b": 1, "c": 1, "d": 0}
    assert count_wins([each for each in boards if each.name in "ad"]) == {"a": 0, "d": 1}
    failed = [replace(boards[0], name=name) for name in "xyz"]
    assert {row.place for row in rank(failed)} == {"–"}
    assert {tuple(line[4:6]) for line in find_overview(failed)} == {("0", "0")}
    make_page(boards).write(tmp_path / "board.html")
    html = (tmp_path / "board.html").read_text()
    assert html.count('<div class="scroll"><table>') == html.count("<table>") == 2
    boards[0].save(tmp_path / "low.json")
    board = BenchSuite(action="board", files=(tmp_path / "low.json",), out=tmp_path / "b.html")
    assert board.run(Console(True, True))["tasks_led"] == {"a": 0}
    assert "suite 2" in (tmp_path / "b.html").read_text()


@pytest.mark.parametrize(
    "options",
    [
        {"action": "verify"},
        {"action": "run"},
        {"action": "run", "out": Path("a.html")},
        {"action": "list", "files": (Path("a.json"),)},
        {"action": "verify", "files": (Path("missing.json"),)},
        {"action": "list", "seeds": (-1,)},
        {"action": "list", "budget": 0.0},
    ],
)
def test_command_lines_that_cannot_be_executed_are_refused(options):
    with pytest.raises(UsageError):
        BenchSuite(**options)


@pytest.mark.skipif(not SUBMISSIONS.is_dir(), reason="a wheel has no submissions")
def test_submissions_that_ship_keep_the_rules_and_name_their_origin():
    files = sorted(SUBMISSIONS.glob("*.json"))
    assert files
    for file in files:
        submission = load_submission(file)
        assert submission.provenance["commit"]
        assert not submission.provenance["dirty"]
