"""The baselines of the suite on made physics: what they find, spend and refuse, and runs that go on."""

import numpy as np
import pytest

from evolution._src.backends.cluster import make_backend
from evolution._src.backends.scoring import Outcome
from evolution._src.cli.commands.bench_suite import METHODS as NAMES
from evolution._src.errors import RunError
from evolution._src.suite import running
from evolution._src.suite import submission as submission_module
from evolution._src.suite import tasks as tasks_module
from evolution._src.suite.baselines import METHODS, Practice, run_baseline
from evolution._src.suite.running import fill_submission, run_suite
from evolution._src.suite.submission import Entry, Score, load_submission
from evolution._src.suite.tasks import EXAM_SEED, EXAM_TRIALS, find_suite_task

FIXED, FREE = "gap, 4 in a row", "gap, any body"
BUDGET = 600.0
LEARNING = [name for name in METHODS if name != "zero"]


def simulate(jobs, threads):
    """The nearer the genes to 0.3 and the more modules the farther; a trial takes 5 s."""
    outcomes = []
    for job in jobs:
        trials = job.trials
        progress = 1.0 - float(np.abs(job.genotype - 0.3).mean()) + 0.1 * trials.find_organism().num_modules
        outcomes.append(
            Outcome(
                progress,
                float(abs(job.genotype[-1])) / 10.0,
                (progress > 1.2,) * trials.count,
                seconds=5.0 * trials.count,
            )
        )
    return outcomes


@pytest.fixture(autouse=True)
def _use_made_physics(monkeypatch):
    make = submission_module.make_backend
    monkeypatch.setattr(submission_module, "make_backend", lambda *args: make(*args, simulate=simulate))
    monkeypatch.setattr(tasks_module, "find_published_arena", lambda name: name)


def run(method, seeds=(0,), **options):
    tasks = (FREE,) if METHODS[method].is_for_free_bodies else (FIXED, FREE)
    return run_suite(method, seeds, tasks, BUDGET, simulate=simulate, **options)


def test_the_command_offers_every_baseline():
    assert NAMES.__args__ == tuple(METHODS)


@pytest.mark.parametrize("method", METHODS)
def test_equal_seeds_give_equal_bits_at_any_number_of_workers(method):
    entries = run(method).entries
    assert run(method, workers=3).entries == entries
    if method != "zero":
        other = run(method, seeds=(1,)).entries[-1]
        assert (other.body, other.genotype) != (entries[-1].body, entries[-1].genotype)


@pytest.mark.parametrize("method", LEARNING)
def test_the_budget_is_spent_and_exceeded_by_one_generation_at_most(method):
    for entry in run(method).entries:
        assert BUDGET <= entry.seconds <= BUDGET + (200.0 if entry.task == FREE else 40.0)


@pytest.mark.parametrize("method", [name for name in LEARNING if name != "random"])
def test_what_learns_is_never_worse_than_zero(method):
    fitness = {entry.task: entry.truth.fitness for entry in run("zero").entries}
    for entry in run(method).entries:
        assert entry.truth.fitness > fitness[entry.task]


def test_the_surrogate_search_finds_large_bodies_where_these_are_better():
    assert run("surrogate").entries[-1].truth.fitness > run("random").entries[-1].truth.fitness


def test_practice_keeps_the_best_and_counts_what_was_simulated():
    task = find_suite_task(FIXED)
    practice = Practice(task, make_backend("batch", 1, simulate=simulate), 12.0)
    body = task.make_trials(task.body, "oscillators", 1, (0,)).find_organism()
    genes = len(practice.make_controller(body).parameters)
    fitness = practice.try_all(body, np.array([np.zeros(genes), np.full(genes, 0.3)]))
    assert (practice.seconds, practice.generation, practice.has_time()) == (10.0, 1, True)
    assert fitness[1] == pytest.approx(1.4 + 1.0 - 0.2 * 0.03)
    practice.try_all(body, np.zeros((1, genes)))
    assert not practice.has_time()
    assert practice.best is not None
    np.testing.assert_array_equal(practice.best.genotype, np.full(genes, 0.3))


def test_baselines_that_do_not_exist_or_suit_are_refused():
    with pytest.raises(RunError, match="method"):
        run_suite("moon", (0,), simulate=simulate)
    with pytest.raises(RunError, match="searches bodies"):
        run_baseline("surrogate", find_suite_task(FIXED), 0, make_backend("batch", 1, simulate=simulate))


def test_a_run_that_was_stopped_goes_on(tmp_path):
    out = tmp_path / "a.json"
    whole = run("random", seeds=(0, 1), out=tmp_path / "whole.json")
    run("random", seeds=(0,), out=out)
    continued = run("random", seeds=(0, 1), out=out)
    assert continued.entries == whole.entries == load_submission(out).entries


def test_entries_of_a_file_are_not_computed_again(tmp_path):
    task, calls = find_suite_task(FIXED), []

    def find_entry(task, seed):
        calls.append(seed)
        if seed == 2 and len(calls) == 3:
            raise KeyboardInterrupt
        body = run("zero").entries[0].body
        return Entry(task.name, seed, body, "oscillators", (0.0,), 1.0, Score(0.0, 0), Score(0.0, 0))

    pairs = [(task, seed) for seed in (0, 1, 2)]
    with pytest.raises(KeyboardInterrupt):
        fill_submission("mine", find_entry, pairs, {"method": "mine"}, tmp_path / "a.json")
    done = fill_submission("mine", find_entry, pairs, {"method": "mine"}, tmp_path / "a.json")
    assert calls == [0, 1, 2, 2]
    assert [entry.seed for entry in done.entries] == [0, 1, 2]


def test_a_file_of_another_run_is_not_continued(tmp_path, monkeypatch):
    run("random", out=tmp_path / "a.json")
    with pytest.raises(RunError, match="differs in: method"):
        run_suite("cmaes", (0,), (FIXED,), BUDGET, simulate=simulate, out=tmp_path / "a.json")
    monkeypatch.setattr(running, "describe_origin", lambda: {"commit": "another"})
    with pytest.raises(RunError, match="name another file"):
        run("random", out=tmp_path / "a.json")


def test_no_generation_of_learning_has_a_seed_of_the_exam():
    """NumPy pads seeds with zeros: a generation 0 would have that of the exam's first trial."""
    asked = []

    def watch(jobs, threads):
        asked.extend(job.trials.seed for job in jobs)
        return simulate(jobs, threads)

    task = find_suite_task(FIXED)
    practice = Practice(task, make_backend("batch", 1, simulate=watch), 60.0)
    body = task.make_trials(task.body, "oscillators", 1, (0,)).find_organism()
    while practice.has_time():
        practice.try_all(body, np.zeros((1, len(practice.make_controller(body).parameters))))
    learned = {int(np.random.SeedSequence(list(seed)).generate_state(1)[0]) for seed in asked}
    exam = set(np.random.SeedSequence(list(EXAM_SEED)).generate_state(EXAM_TRIALS).tolist())
    assert len(learned) == len(asked)
    assert not learned & exam
