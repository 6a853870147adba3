"""What the loop hands out, what it keeps, and what it refuses to live again."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toys

from evolution.backends.trials import Outcome, Randomisation, Scoring
from evolution.controllers.controller import KNOTS
from evolution.errors import RunError
from evolution.search.config import EvolutionConfig
from evolution.search.loop import evolve, load_run, resume
from evolution.search.record import AGAIN, SAMPLE, VALIDATION, Record
from evolution.search.run import Run
from evolution.search.stages import Stage
from evolution.search.validation import Validation, find_candidates

SHORT = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)
SPECIAL = replace(
    SHORT,
    arena="simple",
    modules=5,
    seed=7,
    controller="travelling",
    trials=4,
    randomisation=Randomisation(friction=(0.6, 0.7)),
    scoring=Scoring(success=2.0, effort=0.5, module=0.1),
    environment={"pit": 0.3},  # pyright: ignore[reportArgumentType]
    validation=Validation(rounds=(6, 5), go_on=0.0),
)


def test_every_job_is_what_the_configuration_says():
    observed = toys.Observed()
    run = evolve(SPECIAL, simulate=observed)
    assert len(observed.jobs) == len(run.record.entries)
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        trials = job.trials
        assert np.array_equal(job.genotype, entry.genotype)
        assert (trials.arena, trials.modules, trials.controller) == ("simple", 5, "travelling")
        assert (trials.randomisation, trials.environment) == (SPECIAL.randomisation, (("pit", 0.3),))
        assert trials.count == entry.outcome.trials
        assert trials.count in ((6, 5) if entry.kind == VALIDATION else (4,))
        assert entry.fitness == SPECIAL.scoring.score(entry.outcome, 5)
        assert entry.modules == 5


def test_the_champion_is_what_the_configuration_says():
    run = evolve(SPECIAL, simulate=toys.Observed())
    champion = run.champion
    assert champion is not None
    assert (champion.arena, champion.modules, champion.controller) == ("simple", 5, "travelling")
    assert champion.environment == (("pit", 0.3),)
    assert len(champion.names) == len(champion.genotype) == len(KNOTS)
    assert (champion.successes, champion.trials) == (11, 11)
    pooled = [
        entry for entry in find_candidates(run.record.entries) if entry.generation == champion.generation
    ]
    chosen = [entry for entry in pooled if tuple(entry.genotype) == champion.genotype]
    assert len(chosen) == 1
    assert champion.fitness == chosen[0].fitness
    assert run.stage_champions == (champion,)


def test_a_champion_without_fresh_trials_has_none():
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
    config = replace(SHORT, generations=12, sigma=0.3, handle_noise=True)
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
            "stage": 0,
            "population_size": len(samples),
            "best": max(entry.fitness for entry in samples),
            "median": np.median([entry.fitness for entry in samples]),
            "successes": sum(all(entry.outcome.succeeded) for entry in samples),
            "validated": len({entry.index for entry in entries if entry.kind == VALIDATION}),
            "failures": sum(entry.outcome.error != "" for entry in samples),
        }
        assert {name: row[name] for name in expected} == expected
        again = [entry for entry in entries if entry.kind == AGAIN]
        assert all(np.array_equal(entry.genotype, samples[entry.index].genotype) for entry in again)
    assert run.champion is not None
    last = run.history[-1]
    assert (last["champion_successes"], last["champion_trials"]) == (
        run.champion.successes,
        run.champion.trials,
    )
    assert 0 < last["wall_seconds"] <= time.perf_counter() - began + 0.001
    assert np.array_equal(run.history["wall_seconds"], run.history["wall_seconds"].round(3))


def test_only_the_last_stage_is_validated_and_can_be_solved():
    stages = (Stage("simple", 2, promotion="budget", trials=1), Stage("truth"))
    config = replace(SHORT, generations=6, stages=stages, stop_when_solved=True)
    observed = toys.Observed()
    run = evolve(config, simulate=observed)
    assert run.history["stage"].tolist() == [0, 0, 1]
    assert [champion.arena for champion in run.stage_champions] == ["simple", "truth"]
    assert [champion.trials for champion in run.stage_champions] == [0, Validation().trials]
    assert run.is_solved
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        assert job.trials.arena == ("simple" if entry.generation < 2 else "truth")
        assert entry.kind == SAMPLE or entry.generation == 2
    assert run.history["validated"].tolist() == [0, 0, 2]


def test_a_body_is_solved_once_it_is_as_short_as_it_may_be():
    config = replace(SHORT, body_lengths=(4, 5), generations=20, stop_when_solved=True)
    run = evolve(config, simulate=toys.Observed())
    assert run.is_solved
    assert run.champion is not None
    assert run.champion.modules == 4
    assert len(run.champion.genotype) == len(run.champion.names) == 12
    assert len(run.history) < 20


def test_a_shorter_body_that_holds_stands_before_a_surer_longer_one():
    def simulate(jobs, threads):
        outcomes = toys.Observed()(jobs, threads)
        return [
            replace(outcome, succeeded=(False, *outcome.succeeded[1:]))
            if job.trials.modules < 6 and outcome.trials == 16
            else outcome
            for job, outcome in zip(jobs, outcomes, strict=True)
        ]

    run = evolve(replace(SHORT, body_lengths=(4, 9), generations=12), simulate=simulate)
    tried = find_candidates(run.record.entries)
    assert any(entry.modules >= 6 and all(entry.outcome.succeeded) for entry in tried)
    assert run.champion is not None
    assert run.champion.modules == min(entry.modules for entry in tried) < 6
    assert (run.champion.successes, run.champion.trials) == (46, 48)


def make_run(folder: Path) -> Run:
    return evolve(replace(SHORT, handle_noise=True, folder=str(folder)), simulate=toys.bowl)


def put_back(folder: Path, run: Run, entries: list) -> None:
    record = Record()
    record.entries = entries
    for row in run.history:
        record.add_generation([], {name: row[name] for name in run.history.dtype.names or ()})
    (folder / "record.npz").write_bytes(record.to_bytes(run.config.digest()))


def test_entries_live_again_must_be_those_that_were_tried(tmp_path):
    run = make_run(tmp_path)
    entries = run.record.entries
    put_back(tmp_path, run, entries)
    assert load_run(tmp_path).champion == run.champion
    place = next(place for place, entry in enumerate(entries) if entry.generation == 1)
    one = entries[place]
    for changed, generation in (
        ([*entries[:place], one._replace(kind=VALIDATION), *entries[place + 1 :]], 1),
        ([*entries[:place], one._replace(index=5), *entries[place + 1 :]], 1),
        ([*entries[:place], one._replace(genotype=one.genotype * 1.001), *entries[place + 1 :]], 1),
        ([*entries[:place], *entries[place + 1 :]], 1),
        ([*entries[:place], one, *entries[place:]], 1),
        (entries[:-1], 2),
        ([*entries, entries[-1]], 2),
    ):
        put_back(tmp_path, run, changed)
        for action in (load_run, resume):
            with pytest.raises(RunError) as caught:
                action(tmp_path)
            assert str(caught.value) == (
                f"generation {generation} of {tmp_path} does not come out as recorded: the record was changed, "
                "or NumPy, cma or the processor differ from those it began with (config.json); "
                "resume it where it began, or start anew in another folder"
            )


@pytest.mark.parametrize(
    "changes",
    [
        {"generations": 4},
        {"workers": 2},
        {"backend": "processes"},
        {"address": "here"},
        {"stop_when_solved": True},
        {"generations": 4, "workers": 2, "backend": "processes", "address": "here", "stop_when_solved": True},
    ],
)
def test_how_far_and_by_whom_may_change(tmp_path, changes):
    make_run(tmp_path)
    run = resume(tmp_path, simulate=toys.bowl, **changes)
    assert {name: getattr(run.config, name) for name in changes} == changes
    assert load_run(tmp_path).config == run.config


def test_a_folder_that_was_moved_goes_on_where_it_is(tmp_path):
    before = make_run(tmp_path / "old")
    (tmp_path / "old").rename(tmp_path / "new")
    run = resume(tmp_path / "new", generations=4, simulate=toys.bowl)
    assert run.folder == tmp_path / "new"
    assert run.config.folder == load_run(tmp_path / "new").config.folder == str(tmp_path / "new")
    assert run.history["best"][:3].tolist() == before.history["best"].tolist()
    assert not (tmp_path / "old").exists()


def test_what_decides_the_outcome_may_not_change(tmp_path):
    run = make_run(tmp_path)
    with pytest.raises(
        RunError, match=r"^\['seed', 'sigma'\] cannot change in a run; .*'generations'.* can$"
    ):
        resume(tmp_path, sigma=0.3, generations=4, seed=1)
    assert load_run(tmp_path).config == run.config


def test_a_run_that_goes_on_reports_every_generation_and_keeps_its_time(tmp_path):
    before = make_run(tmp_path)
    heard: list[tuple[int, Path | None]] = []
    told: list[tuple[str, float]] = []
    run = resume(
        tmp_path,
        generations=5,
        simulate=toys.bowl,
        on_generation=lambda run: heard.append((len(run.history), run.folder)),
        progress=lambda message, share: told.append((message, share)),
    )
    assert heard == [(4, tmp_path), (5, tmp_path)]
    assert told == [("generation 4", 0.8), ("generation 5", 1.0)]
    times = run.history["wall_seconds"]
    assert np.array_equal(times[:3], before.history["wall_seconds"])
    assert np.all(np.diff(times) >= 0)
    assert run.folder == tmp_path
    assert evolve(SHORT, simulate=toys.bowl).folder is None


def test_a_folder_that_holds_a_run_says_in_what_it_differs(tmp_path):
    make_run(tmp_path)
    config = replace(SHORT, handle_noise=True, folder=str(tmp_path))
    with pytest.raises(RunError, match="holds this run already; resume it, or name another folder"):
        evolve(config)
    with pytest.raises(
        RunError, match=r"holds another run \(seed: 0, not 1; sigma: 0.5, not 0.2\); resume it"
    ):
        evolve(replace(config, seed=1, sigma=0.2))


def test_a_damaged_record_that_is_left_alone_is_named(tmp_path):
    (tmp_path / "record.npz").write_bytes(b"PK")
    with pytest.raises(RunError, match=rf"^{tmp_path}/record\.npz is damaged"):
        evolve(replace(SHORT, folder=str(tmp_path)), simulate=toys.bowl)


@pytest.mark.parametrize("fails", [False, True])
def test_the_workers_are_those_of_the_configuration_and_are_let_go(monkeypatch, fails):
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

    monkeypatch.setattr("evolution.search.loop.make_backend", make)
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
        heard, told = [], []
        evolve(
            replace(SHORT, folder=folder),
            simulate=toys.bowl,
            on_generation=lambda run, heard=heard: heard.append(len(run.history)),
            progress=lambda message, share, told=told: told.append((message, share)),
        )
        assert heard == [1, 2, 3]
        assert [share for _, share in told] == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_where_noise_decides_there_are_more_trials():
    """Two of the same conditions never agree: the ranks of what is tried again are mere chance."""
    rng = np.random.default_rng(0)

    def chance(jobs, threads):
        return [Outcome(float(rng.normal()), 0.0, (False,) * job.trials.count) for job in jobs]

    run = evolve(replace(SHORT, generations=12, handle_noise=True), simulate=chance)
    counts = [entry.outcome.trials for entry in run.record.entries]
    assert counts[0] == 3
    assert min(counts) == 3
    assert max(counts) > 3
    for entries, _ in run.record.generations():
        assert len({entry.outcome.trials for entry in entries}) == 1
