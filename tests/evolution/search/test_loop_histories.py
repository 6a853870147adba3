"""The loop: it solves, it resumes to the bit, and nobody's help changes what comes out."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toys

from evolution.controllers.controller import REFLEX
from evolution.errors import RunError
from evolution.search.config import EvolutionConfig
from evolution.search.loop import evolve, load_run, resume
from evolution.search.record import AGAIN, HISTORY, SAMPLE, TIMES, VALIDATION, Entry, Record
from evolution.search.run import Run
from evolution.search.stages import Stage
from evolution.search.validation import Validation

TOY = EvolutionConfig(
    arena="truth",
    controller="reactive",
    origin="hint",
    generations=24,
    sigma=0.3,
    restart_after=None,
    stop_when_solved=False,
)


def without_times(history: np.ndarray) -> list:
    names = [name for name in history.dtype.names or () if name not in TIMES]
    return history[names].tolist()


def read_without_times(folder: Path) -> list[list[str]]:
    rows = [line.split(",") for line in (folder / "history.csv").read_text().splitlines()]
    skipped = [rows[0].index(name) for name in TIMES]
    return [[cell for index, cell in enumerate(row) if index not in skipped] for row in rows]


def test_it_solves_and_stops():
    run = evolve(replace(TOY, generations=60, stop_when_solved=True), simulate=toys.bowl)
    assert run.is_solved
    assert len(run.history) < 60
    assert run.champion is not None
    assert run.champion.trials == Validation().trials
    assert np.abs(np.array(run.champion.genotype) - 0.5).max() < 0.5


def test_history_counts_what_was_done():
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


def test_seeds_decide():
    first, second = (evolve(TOY, simulate=toys.bowl) for _ in range(2))
    other = evolve(replace(TOY, seed=1), simulate=toys.bowl)
    assert without_times(first.history) == without_times(second.history)
    assert first.champion == second.champion
    assert without_times(first.history) != without_times(other.history)


VARIANTS = {
    "plain": {},
    "noise": {"handle_noise": True},
    "stages": {
        "stages": (
            Stage("simple", 5, trials=1),
            Stage("truth", promotion="stagnation", patience=3),
            Stage("gsrm"),
        )
    },
    "body": {"body_lengths": (4, 9)},
    "restarts": {"population_size": 4, "generations": 12},
    "restart_after": {"body_lengths": (4, 9), "restart_after": 3},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_two_halves_are_one_run(variant, tmp_path):
    config = replace(TOY, **VARIANTS[variant])
    toy = {"restarts": toys.plain, "restart_after": toys.shortest}.get(variant, toys.bowl)
    whole = evolve(replace(config, folder=str(tmp_path / "whole")), simulate=toy)
    part = config.generations // 3
    evolve(replace(config, generations=part, folder=str(tmp_path / "parts")), simulate=toy)
    resume(tmp_path / "parts", generations=2 * part, simulate=toy)
    parts = resume(tmp_path / "parts", generations=config.generations, simulate=toy)
    assert without_times(whole.history) == without_times(parts.history)
    assert whole.champion == parts.champion
    assert whole.stage_champions == parts.stage_champions
    assert read_without_times(tmp_path / "whole") == read_without_times(tmp_path / "parts")
    assert load_run(tmp_path / "parts").champion == whole.champion


def test_variants_do_what_they_say():
    noise = evolve(replace(TOY, **VARIANTS["noise"]), simulate=toys.bowl)
    assert (noise.record.columns()["kind"] == AGAIN).any()
    staged = evolve(replace(TOY, **VARIANTS["stages"]), simulate=toys.bowl)
    assert sorted(set(staged.history["stage"])) == [0, 1, 2]
    trials = {int(staged.history["stage"][e.generation]): e.outcome.trials for e in staged.record.entries}
    assert (trials[0], trials[1]) == (1, TOY.trials)
    assert [champion.arena for champion in staged.stage_champions] == ["simple", "truth", "gsrm"]
    assert staged.champion == staged.stage_champions[-1]
    restarted = evolve(replace(TOY, **VARIANTS["restarts"]), simulate=toys.plain)
    assert set(restarted.history["restarts"]) >= {0, 1}


def test_the_shortest_body_that_holds_is_found():
    for seed in range(3):
        config = replace(TOY, body_lengths=(4, 10), generations=40, seed=seed)
        run = evolve(config, simulate=toys.shortest)
        assert run.champion is not None
        assert run.champion.modules == 6
        assert run.champion.successes > 0.85 * run.champion.trials


def test_no_body_is_as_long_as_one_that_holds():
    run = evolve(replace(TOY, body_lengths=(4, 10), generations=40), simulate=toys.shortest)
    longest = 10
    for entries, row in run.record.generations():
        samples = [entry for entry in entries if entry.kind == SAMPLE]
        assert max(entry.modules for entry in samples) <= longest
        if row["champion_trials"] == run.config.validation.trials and row["champion_successes"] >= 46:
            longest = min([longest, *(entry.modules - 1 for entry in entries if entry.kind == VALIDATION)])
    assert longest == 5


def find_samples(run: Run, generations: range) -> list[Entry]:
    return [entry for entry in run.record.entries if entry.kind == SAMPLE and entry.generation in generations]


def test_a_search_in_which_nothing_succeeds_begins_anew_where_it_began():
    run = evolve(replace(TOY, generations=11, restart_after=5), simulate=toys.hopeless)
    assert run.history["restarts"].tolist() == 5 * [0] + 5 * [1] + [2]
    assert set(run.history["population_size"]) == {TOY.population_size}
    first, again = (
        np.array([entry.genotype for entry in find_samples(run, range(start, start + 1))]) for start in (0, 5)
    )
    assert np.abs(again.mean(axis=0) - REFLEX).max() < 4 * TOY.sigma / np.sqrt(len(again))
    assert run.history["sigma"][5] == pytest.approx(TOY.sigma, rel=0.3)
    assert not np.allclose(first, again)


@pytest.mark.parametrize("what", ["stages", "bodies"])
def test_a_search_that_has_learned_elsewhere_begins_anew_around_its_fittest(what):
    changes = {"stages": (Stage("truth"),)} if what == "stages" else {"body_lengths": (4, 5)}
    run = evolve(replace(TOY, generations=6, restart_after=5, **changes), simulate=toys.hopeless)
    fittest = max(find_samples(run, range(5)), key=lambda entry: entry.fitness)
    drawn = np.array([entry.genotype for entry in find_samples(run, range(5, 6))])
    mean, genes = drawn.mean(axis=0)[: len(REFLEX)], fittest.genotype[: len(REFLEX)]
    assert np.abs(mean - genes).max() < 4 * TOY.stage_sigma / np.sqrt(len(drawn))
    assert run.history["sigma"][5] == pytest.approx(TOY.stage_sigma, rel=0.3)


def test_an_option_that_is_not_set_says_nothing_in_the_fingerprint():
    digest = TOY.digest()
    assert replace(TOY, restart_after=None, body_lengths=None).digest() == digest
    assert len({digest, *(replace(TOY, restart_after=count).digest() for count in (5, 6))}) == 3
    content = {name: value for name, value in TOY.to_json().items() if name != "restart_after"}
    assert EvolutionConfig.from_json(content).digest() == digest


def test_a_search_in_which_ever_more_succeed_goes_on():
    plain = evolve(TOY, simulate=toys.bowl)
    held = np.zeros(TOY.generations, dtype=int)
    for entry in find_samples(plain, range(TOY.generations)):
        held[entry.generation] += entry.outcome.successes
    records = [-1, *(g for g in range(TOY.generations) if held[g] > held[:g].max(initial=0)), TOY.generations]
    longest = max(np.diff(records)) - 1  # generations in a row without a record
    patient = evolve(replace(TOY, restart_after=longest + 1), simulate=toys.bowl)
    assert without_times(patient.history) == without_times(plain.history)
    impatient = evolve(replace(TOY, restart_after=longest // 2), simulate=toys.bowl)
    assert impatient.history["restarts"][-1] >= 1


def test_among_shorter_bodies_it_begins_anew_around_one_of_them():
    config = replace(TOY, body_lengths=(4, 10), generations=40, restart_after=10)
    run = evolve(config, simulate=toys.shortest)
    too_long = [entry.generation for entry in find_samples(run, range(40)) if entry.modules > 5]
    began = max(too_long) + 1
    restarts = run.history["restarts"]
    anew = began + int(np.flatnonzero(restarts[began:] > restarts[began])[0])
    assert anew == began + 10
    fittest = max(find_samples(run, range(began, anew)), key=lambda entry: entry.fitness)
    genes = np.array([entry.genotype[:-1] for entry in find_samples(run, range(anew, anew + 1))])
    assert np.abs(genes.mean(axis=0) - fittest.genotype[:-1]).max() < 4 * TOY.stage_sigma / np.sqrt(
        len(genes)
    )
    assert run.champion is not None
    assert run.champion.modules == 6


@pytest.mark.parametrize(("backend", "workers"), [("batch", 4), ("processes", 2)])
def test_who_works_changes_nothing(backend, workers, tmp_path):
    alone = evolve(replace(TOY, generations=8, folder=str(tmp_path / "alone")), simulate=toys.bowl)
    config = replace(TOY, generations=8, folder=str(tmp_path / "many"), backend=backend, workers=workers)
    many = evolve(config, simulate=toys.bowl)
    assert many.champion == alone.champion
    assert read_without_times(tmp_path / "alone") == read_without_times(tmp_path / "many")


def test_a_genotype_that_raises_costs_itself_only(tmp_path):
    config = replace(TOY, generations=6, folder=str(tmp_path / "run"))
    run = evolve(config, simulate=toys.fragile)
    columns = run.record.columns()
    failed = columns["error"] != ""
    assert np.array_equal(failed, columns["genotype"][:, 0] > 0.3)
    assert 0 < failed.sum() < len(failed)
    assert run.history["failures"].sum() == failed[columns["kind"] == SAMPLE].sum()
    assert np.isfinite(columns["fitness"]).all()
    assert load_run(tmp_path / "run").record.columns()["error"].tolist() == columns["error"].tolist()


def test_a_run_that_ended_stays_as_it_is(tmp_path):
    folder = tmp_path / "run"
    run = evolve(replace(TOY, generations=3, folder=str(folder)), simulate=toys.bowl)
    again = resume(folder, simulate=toys.bowl)
    assert without_times(again.history) == without_times(run.history)
    assert again.history["wall_seconds"].tolist() == run.history["wall_seconds"].tolist()


def test_callbacks_hear_of_every_generation():
    heard, fractions = [], []
    evolve(
        replace(TOY, generations=4),
        simulate=toys.bowl,
        on_generation=lambda run: heard.append(run.history[-1]["generation"]),
        progress=lambda message, fraction: fractions.append(fraction),
    )
    assert heard == [0, 1, 2, 3]
    assert fractions[-1] == 1.0


def test_generations_live_again_must_come_out_as_recorded(tmp_path):
    folder = tmp_path / "run"
    run = evolve(replace(TOY, generations=4, folder=str(folder)), simulate=toys.bowl)
    entry = run.record.entries[14]
    run.record.entries[14] = entry._replace(genotype=entry.genotype + 1e-9)
    (folder / "record.npz").write_bytes(run.record.to_bytes(run.config.digest()))
    with pytest.raises(RunError, match=r"generation 1 .* does not come out as recorded"):
        resume(folder, simulate=toys.bowl)


def test_a_history_that_was_changed_does_not_come_out(tmp_path):
    """Whatever it tells, but for the time that passed, follows from the entries."""
    config = replace(TOY, generations=4, seed=3, folder=str(tmp_path / "run"))
    record = evolve(config, simulate=toys.bowl).record
    for name in set(HISTORY.names or ()) - {"generation", *TIMES}:
        changed = Record()
        for entries, row in record.generations():
            values = {column: row[column] for column in HISTORY.names or ()}
            values[name] += float(row["generation"] == 2)
            changed.add_generation(entries, values)
        (tmp_path / "run" / "record.npz").write_bytes(changed.to_bytes(config.digest()))
        with pytest.raises(RunError, match=r"generation 2 .* does not come out as recorded"):
            load_run(tmp_path / "run")


PROGRAM = """
import sys
from evolution.search.loop import evolve, resume
from evolution.search.config import EvolutionConfig
from pathlib import Path
import toys
folder = sys.argv[1]
if Path(folder, "config.json").exists():
    resume(folder, simulate=toys.slow_bowl)
else:
    evolve(EvolutionConfig(arena="truth", controller="reactive", origin="hint", generations=24, sigma=0.3,
                       restart_after=None, stop_when_solved=False, folder=folder),
           simulate=toys.slow_bowl)
"""


def run_and_kill(folder: Path, seconds: float) -> int:
    """Run the program and kill it so long after its folder appeared; return its exit status."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(folder)], env=environment)
    while not (folder / "config.json").exists() and process.poll() is None:
        time.sleep(0.002)
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        return process.wait()


def check_kills(tmp_path: Path, moments: np.ndarray) -> int:
    """Kill runs at these moments [s], resume each, compare; return how many were really cut off."""
    whole = evolve(replace(TOY, folder=str(tmp_path / "whole")), simulate=toys.bowl)
    num_cut = 0
    for number, moment in enumerate(moments):
        folder = tmp_path / f"run_{number}"
        num_cut += run_and_kill(folder, moment) == -signal.SIGKILL
        run = resume(folder, simulate=toys.bowl)
        assert run.champion == whole.champion
        assert read_without_times(folder) == read_without_times(tmp_path / "whole")
    return num_cut


def test_a_killed_run_resumes_to_the_same_champion(tmp_path):
    assert check_kills(tmp_path, np.array([0.05, 0.5])) >= 1


@pytest.mark.slow
def test_twenty_killed_runs_resume_to_the_same_champion(tmp_path):
    moments = np.random.default_rng(0).uniform(0.0, 1.5, 20)
    assert check_kills(tmp_path, moments) >= 10


def test_a_search_may_begin_from_zero():
    config = replace(TOY, generations=1, sigma=1e-6)
    hint, zero = (evolve(replace(config, origin=origin), simulate=toys.bowl) for origin in ("hint", "zero"))
    assert np.allclose(zero.record.columns()["genotype"], 0.0, atol=1e-4)
    assert np.allclose(hint.record.columns()["genotype"], REFLEX, atol=1e-4)
