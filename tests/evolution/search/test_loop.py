"""The loop: jobs, champion and history follow from the configuration, the seed and the outcomes."""

import time
from dataclasses import replace

import numpy as np
import pytest
import toys
from histories import TOY, read_without_times, without_times

from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import Randomization
from evolution._src.controllers.controller import NUM_KNOTS
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run
from evolution._src.search.record import SAMPLE, VALIDATION
from evolution._src.search.validation import Validation, find_candidates

SHORT = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)


SPECIAL = replace(
    SHORT,
    arena="simple",
    modules=5,
    seed=7,
    controller="path",
    trials=4,
    randomization=Randomization(friction=(0.6, 0.7)),
    scoring=Scoring(success=2.0, effort=0.5, module=0.1),
    environment={"pit": 0.3},  # pyright: ignore[reportArgumentType]
    validation=Validation(rounds=(6, 5), continue_share=0.0),
)


def test_every_job_follows_the_configuration():
    observed = toys.Observed()
    run = evolve(SPECIAL, simulate=observed)
    assert len(observed.jobs) == len(run.record.entries)
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        trials = job.trials
        assert np.array_equal(job.genotype, entry.genotype)
        assert (trials.arena, trials.modules, trials.controller) == ("simple", 5, "path")
        assert (trials.randomization, trials.environment) == (SPECIAL.randomization, (("pit", 0.3),))
        assert trials.count == entry.outcome.trials
        assert trials.count in ((6, 5) if entry.kind == VALIDATION else (4,))
        assert entry.fitness == SPECIAL.scoring.score(entry.outcome, 5)


def test_the_champion_follows_the_configuration():
    run = evolve(SPECIAL, simulate=toys.Observed())
    champion = run.champion
    assert champion is not None
    assert (champion.arena, champion.modules, champion.controller) == ("simple", 5, "path")
    assert champion.environment == (("pit", 0.3),)
    assert len(champion.names) == len(champion.genotype) == NUM_KNOTS
    assert (champion.successes, champion.trials) == (11, 11)
    pooled = [
        entry for entry in find_candidates(run.record.entries) if entry.generation == champion.generation
    ]
    selected = [entry for entry in pooled if tuple(entry.genotype) == champion.genotype]
    assert len(selected) == 1
    assert champion.fitness == selected[0].fitness


def test_a_champion_may_have_no_validation_trials():
    run = evolve(SHORT, simulate=toys.hopeless)
    assert run.champion is not None
    assert (run.champion.successes, run.champion.trials) == (0, 0)
    fittest = max(
        (entry for entry in run.record.entries if entry.kind == SAMPLE), key=lambda entry: entry.fitness
    )
    assert run.champion.genotype == tuple(fittest.genotype)
    assert not run.history["champion_trials"].any()


@pytest.mark.parametrize("simulate", [toys.bowl, toys.fragile])
def test_history_follows_from_the_entries(simulate):
    config = replace(SHORT, generations=12, sigma=0.3)
    began = time.perf_counter()
    run = evolve(config, simulate=simulate)
    evaluations = trials = 0
    for generation, (entries, row) in enumerate(run.record.generations()):
        samples = [entry for entry in entries if entry.kind == SAMPLE]
        evaluations, trials = (
            evaluations + len(samples),
            trials + sum(entry.outcome.trials for entry in entries),
        )
        assert [entry.index for entry in samples] == list(range(len(samples)))
        expected = {
            "generation": generation,
            "evaluations": evaluations,
            "trials": trials,
            "population_size": len(samples),
            "best": max(entry.fitness for entry in samples),
            "median": np.median([entry.fitness for entry in samples]),
            "successes": sum(all(entry.outcome.succeeded) for entry in samples),
            "validated": len({entry.index for entry in entries if entry.kind == VALIDATION}),
            "failures": sum(entry.outcome.error != "" for entry in samples),
        }
        assert {name: row[name] for name in expected} == expected
    assert run.champion is not None
    last = run.history[-1]
    assert (last["champion_successes"], last["champion_trials"]) == (
        run.champion.successes,
        run.champion.trials,
    )
    assert 0 < last["wall_seconds"] <= time.perf_counter() - began + 0.001
    assert np.array_equal(run.history["wall_seconds"], run.history["wall_seconds"].round(3))


def test_history_counts_evaluations_and_trials():
    run = evolve(TOY, simulate=toys.bowl)
    history = run.history
    assert np.array_equal(history["generation"], np.arange(24))
    assert np.array_equal(history["evaluations"], 12 * np.arange(1, 25))
    kinds = run.record.columns()["kind"]
    assert (kinds == SAMPLE).sum() == 24 * 12
    assert (kinds == VALIDATION).any()
    assert history["trials"][-1] == sum(entry.outcome.trials for entry in run.record.entries)
    assert history["best"][-6:].mean() > history["best"][:6].mean()
    assert np.all(np.diff(history["wall_seconds"]) >= 0)


def test_equal_seeds_give_equal_runs():
    first, second = (evolve(TOY, simulate=toys.bowl) for _ in range(2))
    other = evolve(replace(TOY, seed=1), simulate=toys.bowl)
    assert without_times(first.history) == without_times(second.history)
    assert first.champion == second.champion
    assert without_times(first.history) != without_times(other.history)


@pytest.mark.parametrize(("backend", "workers"), [("batch", 4), ("processes", 2)])
def test_backends_give_equal_runs(backend, workers, tmp_path):
    alone = evolve(replace(TOY, generations=8, folder=str(tmp_path / "alone")), simulate=toys.bowl)
    config = replace(TOY, generations=8, folder=str(tmp_path / "many"), backend=backend, workers=workers)
    many = evolve(config, simulate=toys.bowl)
    assert many.champion == alone.champion
    assert read_without_times(tmp_path / "alone") == read_without_times(tmp_path / "many")


def test_a_solvable_run_is_solved_and_stops():
    run = evolve(replace(TOY, generations=60, stop_when_solved=True), simulate=toys.bowl)
    assert run.is_solved
    assert len(run.history) < 60
    assert run.champion is not None
    assert run.champion.trials == Validation().trials
    assert np.abs(np.array(run.champion.genotype) - 0.5).max() < 0.5


@pytest.mark.parametrize("fails", [False, True])
def test_workers_follow_the_configuration_and_are_stopped(monkeypatch, fails):
    made: list[tuple] = []
    closed: list[bool] = []

    class Workers:
        def run(self, jobs):
            if fails:
                raise KeyboardInterrupt
            return toys.bowl(jobs, 1)

        def close(self):
            closed.append(True)

    def make(*arguments):
        made.append(arguments)
        return Workers()

    monkeypatch.setattr("evolution._src.search.loop.make_backend", make)
    config = replace(SHORT, backend="processes", workers=3, address="here")
    if fails:
        with pytest.raises(KeyboardInterrupt):
            evolve(config, simulate=toys.hopeless)
    else:
        assert len(evolve(config, simulate=toys.hopeless).history) == 3
    assert made == [("processes", 3, "here", toys.hopeless)]
    assert closed == [True]


def test_a_run_in_a_folder_reports_as_one_in_memory_does(tmp_path):
    for folder in (None, str(tmp_path / "run")):
        called, reported = [], []
        evolve(
            replace(SHORT, folder=folder),
            simulate=toys.bowl,
            on_generation=lambda run, called=called: called.append(len(run.history)),
            progress=lambda message, share, reported=reported: reported.append((message, share)),
        )
        assert called == [1, 2, 3]
        assert [share for _, share in reported] == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_callbacks_are_called_for_every_generation():
    called, fractions = [], []
    evolve(
        replace(TOY, generations=4),
        simulate=toys.bowl,
        on_generation=lambda run: called.append(run.history[-1]["generation"]),
        progress=lambda message, fraction: fractions.append(fraction),
    )
    assert called == [0, 1, 2, 3]
    assert fractions[-1] == 1.0


def test_a_genotype_that_raises_affects_no_other(tmp_path):
    config = replace(TOY, generations=6, folder=str(tmp_path / "run"))
    run = evolve(config, simulate=toys.fragile)
    columns = run.record.columns()
    failed = columns["error"] != ""
    assert np.array_equal(failed, columns["genotype"][:, 0] > 0.3)
    assert 0 < failed.sum() < len(failed)
    assert run.history["failures"].sum() == failed[columns["kind"] == SAMPLE].sum()
    assert np.isfinite(columns["fitness"]).all()
    assert load_run(tmp_path / "run").record.columns()["error"].tolist() == columns["error"].tolist()
