"""The run folder: one writer, atomic, and clear about what is wrong with it."""

import csv
import io
import json
import platform
import resource
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toys
from damage import flip_bits
from kills import kill_at_each_moment

from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.record import HISTORY, Record
from evolution._src.search.run import RunFolder, format_history, load_champion

TOY = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)


@pytest.fixture
def folder(tmp_path) -> Path:
    evolve(replace(TOY, folder=str(tmp_path / "run")), simulate=toys.bowl)
    return tmp_path / "run"


def test_a_folder_holds_what_it_promises(folder):
    names = {path.name for path in folder.iterdir()}
    assert {"config.json", "record.npz", "history.csv", "champion.json"} <= names
    content = json.loads((folder / "config.json").read_text())
    assert content["config"]["modules"] == 8
    assert {"python", "numpy", "cma", "mujoco"} <= set(content["versions"])
    header, *rows = (folder / "history.csv").read_text().splitlines()
    assert header.startswith("generation,evaluations,wall_seconds,best,median,sigma,successes")
    assert len(rows) == 3
    assert load_champion(folder) == load_champion(folder / "champion.json") == load_run(folder).champion


def test_it_says_what_it_began_with(folder):
    content = json.loads((folder / "config.json").read_text())
    assert set(content) == {"versions", "machine", "config"}
    assert content["versions"]["python"] == platform.python_version()
    assert content["versions"]["numpy"] == np.__version__
    assert content["machine"] == platform.platform()
    assert EvolutionConfig.from_json(content["config"]) == replace(TOY, folder=str(folder))


def test_who_goes_on_does_not_change_what_it_began_with(folder):
    content = json.loads((folder / "config.json").read_text())
    content["versions"]["numpy"], content["machine"] = "1.0", "another"
    (folder / "config.json").write_text(json.dumps(content))
    resume(folder, generations=4, simulate=toys.bowl)
    again = json.loads((folder / "config.json").read_text())
    assert again["config"]["generations"] == 4
    again["config"]["generations"] = 3
    assert again == content


def test_champion_and_history_say_what_the_run_says(folder):
    run = load_run(folder)
    assert run.champion is not None
    assert run.folder == folder
    assert load_champion(folder) == run.champion
    assert load_champion(str(folder)) == run.champion
    rows = list(csv.reader((folder / "history.csv").read_text().splitlines()))
    assert tuple(rows[0]) == HISTORY.names
    assert [[float(cell) for cell in row] for row in rows[1:]] == [list(row.item()) for row in run.history]
    for name in ("config.json", "champion.json"):
        text = (folder / name).read_text()
        assert text == json.dumps(json.loads(text), indent=2) + "\n", "one field a line"


def test_a_run_without_generations_has_no_champion(tmp_path):
    run = evolve(replace(TOY, generations=0, folder=str(tmp_path / "run")), simulate=toys.bowl)
    assert (run.champion, run.is_solved, len(run.history)) == (None, False, 0)
    assert {path.name for path in (tmp_path / "run").iterdir()} <= {"config.json", ".lock", "record.npz"}
    assert len(resume(tmp_path / "run", generations=2, simulate=toys.bowl).history) == 2


@pytest.mark.parametrize("left", ["config.json", "record.npz"])
def test_what_is_left_of_a_run_is_not_overwritten(folder, left):
    for path in folder.iterdir():
        if path.name not in (left, ".lock"):
            path.unlink()
    with pytest.raises(RunError):
        evolve(replace(TOY, folder=str(folder), seed=1), simulate=toys.bowl)
    assert (folder / left).exists()


def test_nothing_in_it_is_a_pickle(folder):
    with np.load(folder / "record.npz", allow_pickle=False) as arrays:
        assert all(arrays[name].dtype.kind in "USfiuV" for name in arrays)


def test_only_one_process_writes(folder):
    program = (
        f"from evolution._src.search.run import RunFolder\nwith RunFolder({str(folder)!r}).lock():\n"
        "    print('held', flush=True)\n    input()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        with pytest.raises(RunError, match="being written by another run"):
            resume(folder, simulate=toys.bowl)
        assert len(load_run(folder).history) == 3
    finally:
        process.kill()
        process.communicate()
    assert len(resume(folder, generations=4, simulate=toys.bowl).history) == 4


def test_only_one_thread_writes(folder):
    errors = []

    def write() -> None:
        try:
            resume(folder, simulate=toys.bowl)
        except RunError as error:
            errors.append(error)

    with RunFolder(folder).lock():
        thread = threading.Thread(target=write)
        thread.start()
        thread.join()
    assert len(errors) == 1


def test_evolve_does_not_overwrite_a_run(folder):
    with pytest.raises(RunError, match="contains this run already; resume"):
        evolve(replace(TOY, folder=str(folder)), simulate=toys.bowl)
    with pytest.raises(RunError, match="seed: 0, not 7"):
        evolve(replace(TOY, seed=7, folder=str(folder)), simulate=toys.bowl)


def test_a_config_that_contradicts_the_record_is_refused(folder):
    content = json.loads((folder / "config.json").read_text())
    content["config"]["sigma"] = 0.7
    (folder / "config.json").write_text(json.dumps(content))
    with pytest.raises(RunError, match="belongs to another configuration"):
        resume(folder, simulate=toys.bowl)


def test_only_how_it_is_done_may_change(folder):
    with pytest.raises(RunError, match=r"\['seed'\] cannot change"):
        resume(folder, seed=3, simulate=toys.bowl)


def truncate(content: bytes) -> bytes:
    return content[: len(content) // 2]


def flip_a_byte(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 255]) + content[middle + 1 :]


def put_objects(content: bytes) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, format=np.array("symbrion run 1"), digest=np.array([{"a": 1}], dtype=object))
    return buffer.getvalue()


def put_another_format(content: bytes) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, format=np.array("something else"))
    return buffer.getvalue()


@pytest.mark.parametrize(
    "damage",
    [truncate, flip_a_byte, put_objects, put_another_format, lambda content: b"", lambda content: b"PK"],
)
def test_a_damaged_or_foreign_record_is_a_clear_error(folder, damage):
    path = folder / "record.npz"
    damaged = damage(path.read_bytes())
    path.write_bytes(damaged)
    with pytest.raises(RunError, match=r"record\.npz"):
        resume(folder, simulate=toys.bowl)
    assert path.read_bytes() == damaged


def test_a_flipped_bit_gives_the_same_record_or_a_clear_error(folder):
    content = (folder / "record.npz").read_bytes()
    record, digest = Record.from_bytes(content, "record.npz")
    refused = []
    for damaged in flip_bits(content, 600):
        try:
            found, found_digest = Record.from_bytes(damaged, "record.npz")
        except RunError as error:
            refused.append(str(error))
            continue
        assert found_digest == digest
        np.testing.assert_array_equal(found.history, record.history)
        assert found.to_bytes(digest) == record.to_bytes(digest)
    assert len(refused) > 300
    assert all("record.npz" in message for message in refused)


@pytest.mark.parametrize(
    ("name", "values"),
    [("kind", np.array(np.inf)), ("kind", np.array([np.inf])), ("index", np.array(["one"])), ("error", None)],
)
def test_a_record_with_other_columns_is_a_clear_error(folder, name, values):
    with np.load(folder / "record.npz") as file:
        arrays = dict(file)
    num_entries = len(arrays["entry_kind"])
    arrays[f"entry_{name}"] = np.resize(values, num_entries) if np.ndim(values) else np.array(values, float)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    with pytest.raises(RunError, match=r"record\.npz"):
        Record.from_bytes(buffer.getvalue(), "record.npz")


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"config": {"wings": 2}}', '{"config": {"modules": "eight"}}']
)
def test_a_damaged_config_is_a_clear_error(folder, text):
    (folder / "config.json").write_text(text)
    with pytest.raises(RunError, match=r"config\.json"):
        resume(folder, simulate=toys.bowl)


def test_no_run_no_resume(tmp_path):
    with pytest.raises(RunError, match="contains no run"):
        resume(tmp_path)
    with pytest.raises(RunError, match="contains no run"):
        load_run(tmp_path / "nowhere")


def test_a_folder_that_cannot_be_made_is_a_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="cannot be written"):
        evolve(replace(TOY, folder=str(tmp_path / "file" / "run")), simulate=toys.bowl)


def test_a_folder_that_turns_read_only_is_a_clear_error(folder, monkeypatch):
    def refuse(*arguments):
        raise PermissionError(30, "Read-only file system")

    before = (folder / "record.npz").read_bytes()
    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(RunError, match="Read-only file system"):
        resume(folder, generations=5, simulate=toys.bowl)
    assert (folder / "record.npz").read_bytes() == before


def test_the_old_checkpoint_survives_a_full_disk(folder):
    """A limit on the size of files stands for the disk: the write itself fails, half-way."""
    before = (folder / "record.npz").read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 100, hard))
    try:
        with pytest.raises(RunError, match=r"cannot be written .* last checkpoint is kept"):
            resume(folder, generations=30, simulate=toys.bowl)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(folder.glob(".*.part*"))
    survived = load_run(folder)
    assert len(survived.history) >= 3
    assert len(resume(folder, generations=8, simulate=toys.bowl).history) == 8


@pytest.mark.parametrize("left", [(), ("history.csv", "champion.json")])
def test_a_run_that_lost_its_record_is_refused(folder, left):
    for name in {"record.npz", "history.csv", "champion.json"} - set(left):
        (folder / name).unlink()
    before = sorted(folder.iterdir())
    for read in (lambda: resume(folder, simulate=toys.bowl), lambda: load_run(folder)):
        with pytest.raises(RunError, match=r"record\.npz is missing, .*restore it"):
            read()
    assert sorted(folder.iterdir()) == before


def test_a_run_killed_in_its_first_generation_begins_anew(tmp_path):
    def die(*arguments):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evolve(replace(TOY, folder=str(tmp_path)), simulate=die)
    assert load_run(tmp_path).champion is None
    assert len(resume(tmp_path, simulate=toys.bowl).history) == 3


def test_a_kill_at_any_moment_leaves_a_run_that_can_be_begun_or_resumed(tmp_path, monkeypatch):
    monkeypatch.setattr("os.fsync", lambda descriptor: None)
    folder = tmp_path / "run"
    config = replace(TOY, folder=str(folder), generations=2)
    expected = evolve(replace(config, folder=None), simulate=toys.bowl).history["best"].tolist()

    def work() -> None:
        evolve(config, simulate=toys.bowl)

    for _ in kill_at_each_moment(lambda: shutil.rmtree(folder, ignore_errors=True), work):
        if (folder / "config.json").exists():
            run = resume(folder, simulate=toys.bowl)
        else:
            run = evolve(config, simulate=toys.bowl)
        assert run.history["best"].tolist() == expected
        names = {path.name for path in folder.iterdir()}
        assert names - {".lock"} == {"config.json", "record.npz", "history.csv", "champion.json"}


@pytest.mark.parametrize("name", ["history.csv", "champion.json", "record.npz"])
def test_a_run_begins_where_it_writes_over_nothing(folder, tmp_path, name):
    other = tmp_path / "other"
    other.mkdir()
    (folder / name).rename(other / name)
    content = (other / name).read_bytes()
    (other / "notes.txt").write_text("mine")
    with pytest.raises(RunError, match=f"{name}.* but no config.json"):
        evolve(replace(TOY, folder=str(other)), simulate=toys.bowl)
    assert (other / name).read_bytes() == content


def test_removing_a_run_whatever_is_left_of_it_leaves_what_is_not_its_own(folder):
    (folder / "notes.txt").write_text("mine")
    RunFolder(folder).remove()
    assert {path.name for path in folder.iterdir()} - {".lock"} == {"notes.txt"}
    RunFolder(folder).remove()


def test_history_is_written_exactly(folder):
    history = load_run(folder).history
    rows = [line.split(",") for line in format_history(history).splitlines()]
    best = [float(row[rows[0].index("best")]) for row in rows[1:]]
    assert best == history["best"].tolist()


@pytest.mark.parametrize("text", ["", "[]", '{"genotype": [1]}', '{"genotype": [NaN], "names": ["a"]}'])
def test_a_damaged_champion_is_a_clear_error(tmp_path, text):
    (tmp_path / "champion.json").write_text(text)
    with pytest.raises(RunError):
        load_champion(tmp_path)
