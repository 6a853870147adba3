"""The loop: jobs, champion and history follow from the configuration, the seed and the outcomes."""

import time
from dataclasses import replace

import numpy as np
import pytest
import toys
from histories import TOY, without_times

from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import Randomization
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run
from evolution._src.search.record import SAMPLE, VALIDATION
from evolution._src.search.validation import Validation

SHORT = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)
SPECIAL = replace(
    SHORT,
    arena="simple",
    modules=5,
    seed=7,
    controller="posture",
    trials=4,
    randomization=Randomization(friction=(0.6, 0.7)),
    scoring=Scoring(success=2.0, effort=0.5, module=0.1),
    environment={"pit": 0.3},  # pyright: ignore[reportArgumentType]
    validation=Validation(rounds=(6, 5), continue_share=0.0),
)


def test_jobs_and_champion_follow_the_configuration():
    observed = toys.Observed()
    run = evolve(SPECIAL, simulate=observed)
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        trials = job.trials
        assert np.array_equal(job.genotype, entry.genotype)
        assert (trials.arena, trials.modules, trials.controller) == ("simple", 5, "posture")
        assert (trials.randomization, trials.environment) == (SPECIAL.randomization, (("pit", 0.3),))
        assert trials.count == entry.outcome.trials
        assert trials.count in ((6, 5) if entry.kind == VALIDATION else (4,))
        assert entry.fitness == SPECIAL.scoring.score(entry.outcome, 5)
    champion = run.champion
    assert (champion.arena, champion.modules, champion.controller) == ("simple", 5, "posture")
    assert champion.environment == (("pit", 0.3),)
    assert len(champion.names) == len(champion.genotype)
    assert (champion.successes, champion.trials) == (11, 11)
    chosen = {entry.fitness for entry in run.record.entries if tuple(entry.genotype) == champion.genotype}
    assert champion.fitness in chosen


def test_a_champion_may_have_no_validation_trials():
    run = evolve(SHORT, simulate=toys.hopeless)
    assert (run.champion.successes, run.champion.trials) == (0, 0)
    fittest = max(run.record.entries, key=lambda entry: entry.fitness)
    assert run.champion.genotype == tuple(fittest.genotype)
    assert not run.history["champion_trials"].any()


@pytest.mark.parametrize("simulate", [toys.bowl, toys.fragile])
def test_history_follows_from_the_entries(simulate):
    began = time.perf_counter()
    run = evolve(replace(SHORT, generations=12, sigma=0.3), simulate=simulate)
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
    last, champion = run.history[-1], run.champion
    assert (last["champion_successes"], last["champion_trials"]) == (champion.successes, champion.trials)
    assert 0 < last["wall_seconds"] <= time.perf_counter() - began + 0.001
    assert np.all(np.diff(run.history["wall_seconds"]) >= 0)


@pytest.mark.slow
@pytest.mark.parametrize(("backend", "workers"), [("batch", 4), ("processes", 2)])
def test_equal_seeds_give_equal_runs_on_any_backend(backend, workers):
    config = replace(TOY, generations=8)
    alone = evolve(config, simulate=toys.bowl)
    many = evolve(replace(config, backend=backend, workers=workers), simulate=toys.bowl)
    assert many.champion == alone.champion
    assert without_times(many.history) == without_times(alone.history)
    other = evolve(replace(config, seed=1), simulate=toys.bowl)
    assert without_times(other.history) != without_times(alone.history)


def test_a_solvable_run_is_solved_and_stops():
    run = evolve(replace(TOY, generations=60, stop_when_solved=True), simulate=toys.bowl)
    assert run.is_solved
    assert len(run.history) < 60
    assert run.history["best"][-3:].mean() > run.history["best"][:3].mean()
    assert run.champion.trials == Validation().trials
    assert np.abs(np.array(run.champion.genotype) - 0.5).max() < 0.5


@pytest.mark.parametrize("fails", [False, True])
def test_workers_follow_the_configuration_and_are_stopped(monkeypatch, fails):
    made, closed = [], []

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


@pytest.mark.parametrize("is_stored", [False, True])
def test_every_generation_is_reported(tmp_path, is_stored):
    called, reported = [], []
    evolve(
        replace(SHORT, folder=str(tmp_path) if is_stored else None),
        simulate=toys.bowl,
        on_generation=lambda run: called.append(run.history[-1]["generation"]),
        progress=lambda message, share: reported.append((message, share)),
    )
    assert called == [0, 1, 2]
    assert reported == [(f"generation {count} of 3", count / 3) for count in (1, 2, 3)]


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
