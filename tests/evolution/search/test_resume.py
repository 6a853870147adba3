"""Resumed runs equal uninterrupted ones to the bit, whenever they were killed; changed records are refused."""

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
from histories import TOY, read_without_times, without_times

from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.record import HISTORY, TIMES, VALIDATION, Record
from evolution._src.search.run import Run

SHORT = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)


VARIANTS = {
    "plain": {},
    "restarts": {"population_size": 4, "generations": 12},
    "restart_after": {"restart_after": 3},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_resumed_run_equals_an_uninterrupted_one(variant, tmp_path):
    config = replace(TOY, **VARIANTS[variant])
    toy = toys.plain if variant == "restarts" else toys.bowl
    whole = evolve(replace(config, folder=str(tmp_path / "whole")), simulate=toy)
    part = config.generations // 3
    evolve(replace(config, generations=part, folder=str(tmp_path / "parts")), simulate=toy)
    resume(tmp_path / "parts", generations=2 * part, simulate=toy)
    parts = resume(tmp_path / "parts", generations=config.generations, simulate=toy)
    assert without_times(whole.history) == without_times(parts.history)
    assert whole.champion == parts.champion
    assert read_without_times(tmp_path / "whole") == read_without_times(tmp_path / "parts")
    assert load_run(tmp_path / "parts").champion == whole.champion


def test_a_search_restarts_on_a_plain():
    restarted = evolve(replace(TOY, **VARIANTS["restarts"]), simulate=toys.plain)
    assert set(restarted.history["restarts"]) >= {0, 1}


def make_run(folder: Path) -> Run:
    return evolve(replace(SHORT, folder=str(folder)), simulate=toys.bowl)


def write_record(folder: Path, run: Run, entries: list) -> None:
    record = Record()
    record.entries = entries
    for row in run.history:
        record.add_generation([], {name: row[name] for name in run.history.dtype.names or ()})
    (folder / "record.npz").write_bytes(record.to_bytes(run.config.digest()))


def test_replayed_entries_must_equal_the_recorded_ones(tmp_path):
    run = make_run(tmp_path)
    entries = run.record.entries
    write_record(tmp_path, run, entries)
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
        write_record(tmp_path, run, changed)
        for action in (load_run, resume):
            with pytest.raises(RunError) as caught:
                action(tmp_path)
            assert str(caught.value) == (
                f"generation {generation} of {tmp_path} does not replay as recorded: the record was changed, "
                "or NumPy, cma or the processor differ from those it began with (config.json); "
                "resume it where it began, or start again in another folder"
            )


def test_a_changed_genotype_is_noticed_in_replay(tmp_path):
    folder = tmp_path / "run"
    run = evolve(replace(TOY, generations=4, folder=str(folder)), simulate=toys.bowl)
    entry = run.record.entries[14]
    run.record.entries[14] = entry._replace(genotype=entry.genotype + 1e-9)
    (folder / "record.npz").write_bytes(run.record.to_bytes(run.config.digest()))
    with pytest.raises(RunError, match=r"generation 1 .* does not replay as recorded"):
        resume(folder, simulate=toys.bowl)


def test_a_changed_history_is_noticed_in_replay(tmp_path):
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
        with pytest.raises(RunError, match=r"generation 2 .* does not replay as recorded"):
            load_run(tmp_path / "run")


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
def test_runtime_fields_may_change(tmp_path, changes):
    make_run(tmp_path)
    run = resume(tmp_path, simulate=toys.bowl, **changes)
    assert {name: getattr(run.config, name) for name in changes} == changes
    assert load_run(tmp_path).config == run.config


def test_fields_that_decide_results_may_not_change(tmp_path):
    run = make_run(tmp_path)
    with pytest.raises(
        RunError, match=r"^\['seed', 'sigma'\] cannot change in a run; .*'generations'.* can$"
    ):
        resume(tmp_path, sigma=0.3, generations=4, seed=1)
    assert load_run(tmp_path).config == run.config


def test_a_moved_folder_is_resumed_where_it_is(tmp_path):
    before = make_run(tmp_path / "old")
    (tmp_path / "old").rename(tmp_path / "new")
    run = resume(tmp_path / "new", generations=4, simulate=toys.bowl)
    assert run.folder == tmp_path / "new"
    assert run.config.folder == load_run(tmp_path / "new").config.folder == str(tmp_path / "new")
    assert run.history["best"][:3].tolist() == before.history["best"].tolist()
    assert not (tmp_path / "old").exists()


def test_a_resumed_run_reports_every_new_generation_and_keeps_its_times(tmp_path):
    before = make_run(tmp_path)
    called: list[tuple[int, Path | None]] = []
    reported: list[tuple[str, float]] = []
    run = resume(
        tmp_path,
        generations=5,
        simulate=toys.bowl,
        on_generation=lambda run: called.append((len(run.history), run.folder)),
        progress=lambda message, share: reported.append((message, share)),
    )
    assert called == [(4, tmp_path), (5, tmp_path)]
    assert reported == [("generation 4", 0.8), ("generation 5", 1.0)]
    times = run.history["wall_seconds"]
    assert np.array_equal(times[:3], before.history["wall_seconds"])
    assert np.all(np.diff(times) >= 0)
    assert run.folder == tmp_path
    assert evolve(SHORT, simulate=toys.bowl).folder is None


def test_evolve_names_the_differences_to_an_existing_run(tmp_path):
    make_run(tmp_path)
    config = replace(SHORT, folder=str(tmp_path))
    with pytest.raises(RunError, match="contains this run already; resume it, or name another folder"):
        evolve(config)
    with pytest.raises(
        RunError, match=r"contains another run \(seed: 0, not 1; sigma: 0.5, not 0.2\); resume it"
    ):
        evolve(replace(config, seed=1, sigma=0.2))


def test_a_finished_run_stays_as_it_is(tmp_path):
    folder = tmp_path / "run"
    run = evolve(replace(TOY, generations=3, folder=str(folder)), simulate=toys.bowl)
    again = resume(folder, simulate=toys.bowl)
    assert without_times(again.history) == without_times(run.history)
    assert again.history["wall_seconds"].tolist() == run.history["wall_seconds"].tolist()


PROGRAM = """
import sys
from evolution._src.search.loop import evolve, resume
from evolution._src.search.config import EvolutionConfig
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


def test_a_damaged_record_that_stays_is_named(tmp_path):
    (tmp_path / "record.npz").write_bytes(b"PK")
    with pytest.raises(RunError, match=rf"^{tmp_path}/record\.npz is damaged"):
        evolve(replace(TOY, generations=3, folder=str(tmp_path)), simulate=toys.bowl)
