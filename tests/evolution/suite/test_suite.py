"""The benchmark suite on made physics: rules of tasks, baselines, files, verification and the ranking."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evolution._src.backends.cluster import make_backend
from evolution._src.backends.scoring import Outcome
from evolution._src.cli.command import UsageError
from evolution._src.cli.commands.bench_suite import METHODS as NAMES
from evolution._src.cli.commands.bench_suite import BenchSuite
from evolution._src.errors import RunError
from evolution._src.suite import baselines
from evolution._src.suite import exam as exam_module
from evolution._src.suite import tasks as tasks_module
from evolution._src.suite.baselines import METHODS, Practice, run_suite
from evolution._src.suite.exam import TRIALS, Exam, Result, Score, hold_exam
from evolution._src.suite.leaderboard import estimate, make_page, rank
from evolution._src.suite.submission import Entry, Submission, fill_submission, load_submission
from evolution._src.suite.tasks import SEEDS, SUITE, find_published_arena, find_suite_task, make_true_arena
from symbrion_gym._src.arenas.arena import Arena

SUBMISSIONS = Path(__file__).parents[3] / "benchmarks" / "submissions"
TASK, OTHER = "stairs, 5 in a row", "pit, 5 in a row"
BUDGET = 400.0


def simulate(jobs, threads):
    """The nearer the genes to 0.3 and the more modules the farther; trials take 5 s; the truth is a little harder."""
    outcomes = []
    for job in jobs:
        trials = job.trials
        is_true = not isinstance(trials.arena, str)
        progress = 1.0 - float(np.abs(job.genotype - 0.3).mean()) + 0.1 * trials.find_organism().num_modules
        progress -= 0.1 * is_true
        effort, successes = float(abs(job.genotype[-1])) / 10.0, (progress > 1.2,) * trials.count
        outcomes.append(Outcome(progress, effort, successes, seconds=5.0 * trials.count))
    return outcomes


def find_no_ground():
    raise ValueError("no ground")


@pytest.fixture(autouse=True)
def _use_made_physics(monkeypatch):
    monkeypatch.setattr(exam_module, "make_exam_scan", lambda place, seed: f"{place} {seed}")
    monkeypatch.setattr(tasks_module, "find_published_arena", lambda name: name)


def run(method, seeds=(0,), tasks=(TASK, OTHER), **options):
    return run_suite(method, seeds, tasks, BUDGET, simulate=simulate, **options)


def examine(*methods):
    """Return the fitness in the truth by task and baseline."""
    exam = hold_exam([run(method) for method in methods], 0, simulate=simulate)
    return {(row.task, row.submission.partition(",")[0]): row.fitness for row in rank(exam)}


@pytest.fixture
def entry():
    return run("zero", tasks=(TASK,)).entries[0]


def test_the_suite_has_tasks_and_the_command_every_baseline():
    assert len({task.name for task in SUITE}) == len(SUITE) == 2
    assert NAMES.__args__ == tuple(METHODS)


def test_every_task_has_a_scan_that_ships_and_an_exact_counterpart():
    for task in SUITE:
        scan, exact = Arena.load(find_published_arena(task.place)), make_true_arena(task.place)
        assert scan.course is None  # nothing of the truth is in the scan
        np.testing.assert_allclose(scan.surface.bounds, exact.surface.bounds, atol=0.3)
        assert sum(path.stat().st_size for path in find_published_arena(task.place).rglob("*.obj")) < 300_000


@pytest.mark.parametrize("method", METHODS)
def test_equal_seeds_give_equal_bits_at_any_number_of_workers_and_learning_beats_nothing(method):
    entries = run(method).entries
    assert run(method, workers=3).entries == entries
    if method == "zero":
        return
    other = run(method, seeds=(1,)).entries[-1]
    assert (other.body, other.genotype) != (entries[-1].body, entries[-1].genotype)
    for entry in entries:  # a generation that has begun is finished
        assert 0.8 * BUDGET <= entry.seconds <= BUDGET + 40.0
    rows = examine("zero", method)
    least = {"cmaes": 1e-3, "path": 0.0}.get(method, -np.inf)  # "path" has too many genes for this budget
    assert all(rows[each.task, method] >= rows[each.task, "zero"] + least for each in entries)


def test_practice_counts_time_and_tries_the_best_again():
    asked = []

    def watch(jobs, threads):
        asked.extend(job.trials for job in jobs)
        return simulate(jobs, threads)

    practice = Practice(find_suite_task(TASK), "oscillators", make_backend("batch", 1, simulate=watch), 12.0)
    genes = len(practice.controller.parameters)
    fitness = practice.try_all(np.array([np.zeros(genes), np.full(genes, 0.3)]))
    assert (practice.seconds, practice.generation, practice.has_time()) == (10.0, 1, False)
    assert fitness[1] == pytest.approx(1.5 + 1.0 - 0.2 * 0.03)
    np.testing.assert_array_equal(practice.choose(), np.full(genes, 0.3))
    assert practice.seconds == 10.0  # no time is left to try it again
    practice.budget = 62.0
    np.testing.assert_array_equal(practice.choose(), np.full(genes, 0.3))
    assert practice.seconds == 10.0 + 2 * 5 * 5.0
    assert [trials.count for trials in asked] == [1, 1, 5, 5]
    learned = {int(np.random.SeedSequence(list(trials.seed)).generate_state(1)[0]) for trials in asked}
    assert len(learned) == 2


def test_what_does_not_exist_or_suit_is_refused():
    with pytest.raises(RunError, match="no task 'moon'"):
        find_suite_task("moon")
    with pytest.raises(RunError, match="method"):
        run_suite("moon", (0,), simulate=simulate)
    with pytest.raises(RunError, match="none of 8 genotypes could be tried: ValueError: no ground"):
        run_suite("random", (0,), simulate=lambda jobs, threads: find_no_ground())
    # before anything is run
    with pytest.raises(RunError, match="the seed is 12; those of the tasks are 0, 1"):
        run_suite("zero", (0, 12), simulate=lambda jobs, threads: pytest.fail("a search was begun"))


def test_a_run_that_was_stopped_goes_on_and_computes_no_entry_again(tmp_path, entry):
    out, calls = tmp_path / "a.json", []
    whole = run("random", seeds=(0, 1), out=tmp_path / "whole.json")
    run("random", seeds=(0,), out=out)
    assert run("random", seeds=(0, 1), out=out).entries == whole.entries == load_submission(out).entries

    def find_entry(task, seed):
        calls.append(seed)
        if seed == 2 and len(calls) == 3:
            raise KeyboardInterrupt
        return Entry(task.name, seed, entry.body, "oscillators", (0.0,) * 8, 1.0)

    pairs = [(find_suite_task(TASK), seed) for seed in (0, 1, 2)]
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


def test_a_submission_is_read_as_written_and_says_nothing_of_its_worth(tmp_path):
    found = run("cmaes")
    found.save(tmp_path / "a.json")
    assert load_submission(tmp_path / "a.json").entries == found.entries
    content = json.loads((tmp_path / "a.json").read_text())
    content["entries"][0]["truth"] = {"fitness": 9.0, "successes": 10}
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(RunError, match="truth"):
        load_submission(tmp_path / "a.json")


def test_an_exam_draws_scans_and_conditions_from_its_seed_and_ranks_nothing_that_was_not_tried(entry):
    seen = []

    def watch(jobs, threads):
        seen.extend((str(job.trials.arena), job.trials.seed, job.trials.count) for job in jobs)
        return simulate(jobs, threads)

    good, bad = (
        Submission("good", (entry,)),
        Submission("bad", (entry, replace(entry, seed=1, controller="moon:Law"))),
    )
    exam = hold_exam([bad, good], 7, simulate=watch)
    assert seen[0] == ("stairs 7", (7, 0), TRIALS)
    assert {seed for _, seed, _ in seen} == {(7, 0), (7, 1)}
    assert [row.submission for row in rank(exam)] == ["good"]
    assert [name for name, _ in exam.untried] == ["bad"]
    exam = hold_exam([good, replace(good, name="GOOD"), Submission("empty", ())], 0, simulate=simulate)
    assert [name for name, _ in exam.untried] == ["GOOD", "empty"]
    assert {result.submission for result in exam.results} == {"good"}


CHEAT = """
import numpy as np
from evolution._src.suite import exam
exam.Score.__new__ = lambda cls, *args: (9.0, 10)
class Cheat:
    name, version, sensors, parameters = "cheat", "1", ("pitch",), ("a",)
    lower, upper, initial = (-1.0,), (1.0,), (0.0,)
    def __init__(self, organism, num_tracks): self.size = len(organism.servos) + num_tracks
    def begin(self, count): return np.zeros(count)
    def act(self, observation, genotype, structure, state):
        if genotype[0, 0] > 0.8: __import__("time").sleep(60.0)
        if genotype[0, 0] > 0.5: raise SystemExit(0)
        if genotype[0, 0] < -0.5: raise ValueError("no such\\ngene")
        return np.tile(state[:, None], (1, self.size)), state + 1
class Peek(Cheat):
    sensors = ("odometry",)
"""


@pytest.mark.slow
def test_code_of_a_submission_gives_actions_alone(entry, tmp_path, monkeypatch, capfd):
    (tmp_path / "cheat.py").write_text(CHEAT)
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "signal.py").write_text("open('mark', 'w')\n")  # in place of Python's own
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path / "here")
    acted = []

    def act(jobs, threads):
        law, seen = job_law(jobs[0]), np.zeros((2, 4))
        state = law.begin(2)
        for _ in range(3):
            actions, state = law.act(seen, np.tile(jobs[0].genotype, (2, 1)), {"pitch": slice(0, 4)}, state)
            state[0] = True  # the first row begins again
            acted.append(actions[:, 0].tolist())
        return simulate(jobs, threads)

    own = replace(entry, controller="cheat:Cheat", genotype=(0.0,))
    ended = Submission("ended", (replace(own, genotype=(0.6,)),))
    hangs = Submission("hangs", (replace(own, genotype=(0.9,)),))
    raises = Submission("raises", (replace(own, genotype=(-0.6,)),))
    peeks = Submission("peeks", (replace(own, controller="cheat:Peek"),))
    opens = Submission("opens", (replace(own, controller="cheat:np.lib.stride_tricks.np.zeros"),))
    many = Submission("many", (replace(own, genotype=(0.0,) * 9),))
    exam = hold_exam(
        [Submission("cheat", (own,)), ended, raises, peeks, opens, many], 0, allow=("cheat",), simulate=act
    )
    told = capfd.readouterr().err.splitlines()
    assert [line.partition(": ")[0] for line in told] == [
        "cheat:Cheat",
        "cheat:np.lib.stride_tricks.np.zeros",
    ]
    assert acted[:3] == [[0.0, 0.0], [0.0, 1.0], [0.0, 2.0]]
    assert exam.results[0].truth.successes == 0
    assert [name for name, _ in exam.untried] == ["ended", "raises", "peeks", "opens", "many"]
    assert "9 genes" in exam.untried[4][1]
    assert "reads odometry" in exam.untried[2][1]
    assert not (tmp_path / "here" / "mark").exists()
    monkeypatch.setattr(exam_module, "_PATIENCE", 4.0)
    assert hold_exam([hangs], 0, allow=("cheat",), simulate=act).untried[0][0] == "hangs"
    assert "cheat" not in sys.modules


def job_law(job):
    return job.trials.make_controller(job.trials.find_organism())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body": "SF0F0000"}, "the task gives"),
        ({"genotype": (float("nan"),) * 8, "controller": "cheat:Cheat"}, "not finite"),
        ({"seconds": 1e4}, "were spent"),
        ({"task": "moon"}, "no task 'moon'"),
        ({"body": "/etc/hostname"}, "the task gives"),
        ({"genotype": (0.0,) * 9}, "9 genes"),
        ({"seed": -1}, "those of the tasks"),
    ],
)
def test_entries_that_break_a_rule_are_refused(entry, changes, message):
    with pytest.raises(RunError, match=message):
        Submission("broken", (replace(entry, **changes),))
    with pytest.raises(RunError, match="more than one entry"):
        Submission("twice", (entry, replace(entry, genotype=(0.5,) * 8)))


def test_files_that_are_no_submission_are_refused(tmp_path, entry):
    path = tmp_path / "a.json"
    with pytest.raises(RunError, match="cannot be read"):
        load_submission(path)
    Submission("zero", (entry,)).save(path)
    content = json.loads(path.read_text())
    changes = (
        {"format": "other"},
        {"version": "0"},
        {"version": 3},
        {"entries": [{"task": TASK}]},
        {"name": "path "},
        {"name": "path  x"},
    )
    for change in (*changes, {"name": ""}, {"entries": content["entries"] * 2}):
        path.write_text(json.dumps(content | change))
        with pytest.raises(
            RunError, match=r"no submission|of suite '0'|cannot be read|letters|more than one"
        ):
            load_submission(path)


def make_exam(entry, scores):
    """Return an exam with these successes of each submission, in the truth, seed after seed."""
    results = [
        Result(
            name,
            replace(entry, seed=SEEDS[number], genotype=(0.1 * number,) * 8),
            Score(1.0, 0),
            Score(float(number), each),
        )
        for name, successes in scores.items()
        for number, each in enumerate(successes)
    ]
    return Exam(3, tuple(results), (("told", "not allowed"),))


def test_an_estimate_is_the_interquartile_mean_with_an_interval_that_narrows_with_seeds():
    assert estimate([4]) == (4, 4, 4)
    assert estimate([0, 5, 5, 5, 100]).mean == 5
    few, many = (estimate(np.random.default_rng(0).normal(5.0, 1.0, number)) for number in (5, 500))
    assert few.low < few.mean < few.high
    assert many.high - many.low < 0.5 * (few.high - few.low)


def test_the_ranking_is_by_successes_in_the_truth_with_ties_and_no_place_without_one(tmp_path, entry):
    count = len(SEEDS)
    scores = {
        "a": (0,) * count,
        "b": (7,) * count,
        "c": (7, 7, 6, 7, 8) * (count // 5),
        "d": (4,) * count,
        "few seeds": (10,) * (count - 1),
    }
    exam = make_exam(entry, scores)
    found = [(row.submission, row.place) for row in rank(exam)]
    assert found == [("few seeds", "–"), ("b", "1="), ("c", "1="), ("d", "3"), ("a", "–")]
    make_page(exam, [Submission("a", (entry,))]).write(tmp_path / "board.html")
    html = (tmp_path / "board.html").read_text()
    copied = exam._replace(results=tuple(each._replace(entry=entry) for each in exam.results))
    assert {(row.seeds, row.place) for row in rank(copied)} == {(1, "–")}  # one genotype under all seeds
    assert html.count('<div class="scroll"><table>') == html.count("<table>") == 1
    assert "exam seed 3" in html
    assert "told: not allowed" in html


@pytest.mark.parametrize(
    "options",
    [
        {"action": "board"},
        {"action": "run"},
        {"action": "run", "out": Path("a.html")},
        {"action": "list", "files": (Path("a.json"),)},
        {"action": "board", "files": (Path("missing.json"),)},
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
        assert submission.provenance["versions"]["symbrion-gym"]
