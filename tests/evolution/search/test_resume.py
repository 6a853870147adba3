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
from evolution._src.search.run import RECORD

SHORT = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, {"population_size": 4, "generations": 12}, {"restart_after": 3}])
def test_a_resumed_run_equals_an_uninterrupted_one(changes, tmp_path):
    config = replace(TOY, **changes)
    toy = toys.plain if "population_size" in changes else toys.bowl
    whole = evolve(replace(config, folder=str(tmp_path / "whole")), simulate=toy)
    assert bool(whole.history["restarts"].any()) is bool(changes)
    part = config.generations // 3
    evolve(replace(config, generations=part, folder=str(tmp_path / "parts")), simulate=toy)
    resume(tmp_path / "parts", generations=2 * part, simulate=toy)
    parts = resume(tmp_path / "parts", generations=config.generations, simulate=toy)
    assert without_times(whole.history) == without_times(parts.history)
    assert read_without_times(tmp_path / "whole") == read_without_times(tmp_path / "parts")
    assert load_run(tmp_path / "parts").champion == parts.champion == whole.champion


@pytest.fixture
def run(tmp_path):
    return evolve(replace(SHORT, folder=str(tmp_path)), simulate=toys.bowl)


def test_replayed_entries_must_equal_the_recorded_ones(run, tmp_path):
    entries = run.record.entries
    place = next(place for place, entry in enumerate(entries) if entry.generation == 1)
    one, before, after = entries[place], entries[:place], entries[place + 1 :]
    for changed, generation in (
        ([*before, one._replace(kind=VALIDATION), *after], 1),
        ([*before, one._replace(index=5), *after], 1),
        ([*before, one._replace(body="."), *after], 1),
        ([*before, one._replace(genotype=one.genotype + 1e-9), *after], 1),
        ([*before, *after], 1),
        ([*before, one, one, *after], 1),
        (entries[:-1], 2),
        ([*entries, entries[-1]], 2),
    ):
        record = Record(changed, run.history)
        (tmp_path / RECORD).write_bytes(record.to_bytes(run.config.digest()))
        for action in (load_run, resume):
            with pytest.raises(RunError) as caught:
                action(tmp_path)
            assert str(caught.value) == (
                f"generation {generation} of {tmp_path} does not replay as recorded: the record was changed, "
                "or NumPy, cma or the processor differ from those it began with (config.json); "
                "resume it where it began, or start again in another folder"
            )


def test_a_changed_history_is_noticed_in_replay(run, tmp_path):
    """Whatever it tells, but for the time that passed, follows from the entries."""
    for name in set(HISTORY.names or ()) - {"generation", *TIMES}:
        history = run.history
        history[name][1] += 1
        (tmp_path / RECORD).write_bytes(Record(run.record.entries, history).to_bytes(run.config.digest()))
        with pytest.raises(RunError, match=r"generation 1 .* does not replay as recorded"):
            load_run(tmp_path)


@pytest.mark.slow
def test_runtime_fields_may_change_and_those_that_decide_results_may_not(run, tmp_path):
    changes = {
        "generations": 4,
        "workers": 2,
        "backend": "processes",
        "address": "here",
        "stop_when_solved": True,
    }
    with pytest.raises(
        RunError, match=r"^\['seed', 'sigma'\] cannot change in a run; .*'generations'.* can$"
    ):
        resume(tmp_path, sigma=0.3, generations=4, seed=1)
    assert load_run(tmp_path).config == run.config
    changed = resume(tmp_path, simulate=toys.bowl, **changes)
    assert {name: getattr(changed.config, name) for name in changes} == changes
    assert load_run(tmp_path).config == changed.config


def test_a_run_does_not_become_shorter(run, tmp_path):
    with pytest.raises(RunError, match="generations is 2, but the run has 3 generations; give that or more"):
        resume(tmp_path, generations=2, simulate=toys.bowl)
    assert len(resume(tmp_path, generations=3, simulate=toys.bowl).history) == 3


def test_a_moved_folder_is_resumed_where_it_is(run, tmp_path):
    moved = tmp_path.rename(tmp_path.with_name("moved"))
    again = resume(moved, generations=4, simulate=toys.bowl)
    assert again.folder == moved
    assert again.config.folder == load_run(moved).config.folder == str(moved)
    assert again.history["best"][:3].tolist() == run.history["best"].tolist()


def test_a_resumed_run_reports_every_new_generation_and_keeps_its_times(run, tmp_path):
    called, reported = [], []
    again = resume(
        tmp_path,
        generations=5,
        simulate=toys.bowl,
        on_generation=lambda run: called.append((len(run.history), run.folder)),
        progress=lambda *each: reported.append(each),
    )
    assert called == [(4, tmp_path), (5, tmp_path)]
    assert reported == [("generation 4 of 5", 0.5), ("generation 5 of 5", 1.0)]  # of what was left
    times = again.history["wall_seconds"]
    assert np.array_equal(times[:3], run.history["wall_seconds"])
    assert np.all(np.diff(times) >= 0)
    assert resume(tmp_path, simulate=toys.bowl).history.tolist() == again.history.tolist()


def test_evolve_names_the_differences_to_an_existing_run(run, tmp_path):
    for changes, message in (
        ({}, r"contains this run already; `symbrion resume \S+` goes on with it; or name another folder"),
        (
            {"seed": 1, "sigma": 0.2},
            r"contains another run \(seed: 0, not 1; sigma: 0.5, not 0.2\); `symbrion resume",
        ),
    ):
        with pytest.raises(RunError, match=message):
            evolve(replace(SHORT, folder=str(tmp_path), **changes), simulate=toys.bowl)


PROGRAM = """
import sys
from pathlib import Path
import toys
from evolution._src.search.loop import evolve, resume
from histories import TOY
from dataclasses import replace
folder = sys.argv[1]
if Path(folder, "config.json").exists():
    resume(folder, simulate=toys.slow_bowl)
else:
    evolve(replace(TOY, folder=folder), simulate=toys.slow_bowl)
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


@pytest.mark.slow
def test_a_killed_run_resumes_to_the_same_champion(tmp_path):
    assert check_kills(tmp_path, np.array([0.05, 0.5])) >= 1
