"""The run folder: one writer, atomic, and clear about what is wrong with it."""

import csv
import json
import os
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
from evolution._src.search.run import RunFolder, load_champion

TOY = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)
FILES = ("config.json", "record.npz", "history.csv", "champion.json")


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    return evolve(replace(TOY, folder=str(tmp_path_factory.mktemp("run"))), simulate=toys.bowl).folder


@pytest.fixture
def folder(finished, tmp_path) -> Path:
    shutil.copytree(finished, tmp_path / "run")
    return tmp_path / "run"


def test_a_folder_holds_what_it_promises(finished):
    assert {path.name for path in finished.iterdir()} - {".lock"} == set(FILES)
    content = json.loads((finished / "config.json").read_text())
    assert set(content) == {"versions", "machine", "config"}
    assert {"python", "numpy", "cma", "mujoco"} <= set(content["versions"])
    assert content["machine"] == platform.platform()
    assert EvolutionConfig.from_json(content["config"]) == replace(TOY, folder=str(finished))
    run = load_run(finished)
    assert load_champion(finished) == load_champion(str(finished / "champion.json")) == run.champion
    rows = list(csv.reader((finished / "history.csv").read_text().splitlines()))
    assert tuple(rows[0]) == HISTORY.names
    assert [[float(cell) for cell in row] for row in rows[1:]] == [list(row.item()) for row in run.history]
    for name in ("config.json", "champion.json"):
        text = (finished / name).read_text()
        assert text == json.dumps(json.loads(text), indent=2) + "\n", "one field a line"
    with np.load(finished / "record.npz", allow_pickle=False) as arrays:
        assert all(arrays[name].dtype.kind in "USfiuV" for name in arrays)


def test_who_goes_on_does_not_change_what_it_began_with(folder):
    content = json.loads((folder / "config.json").read_text())
    content["versions"]["numpy"], content["machine"] = "1.0", "another"
    (folder / "config.json").write_text(json.dumps(content))
    resume(folder, generations=4, simulate=toys.bowl)
    again = json.loads((folder / "config.json").read_text())
    changed = {"generations": 4, "folder": str(folder)}
    assert again == content | {"config": content["config"] | changed}


def test_a_run_without_generations_has_no_champion(tmp_path):
    run = evolve(replace(TOY, generations=0, folder=str(tmp_path)), simulate=toys.bowl)
    assert (run.champion, run.is_solved, len(run.history)) == (None, False, 0)
    assert {path.name for path in tmp_path.iterdir()} - {".lock"} == {"config.json", "record.npz"}
    assert len(resume(tmp_path, generations=2, simulate=toys.bowl).history) == 2


@pytest.mark.parametrize("left", FILES)
def test_what_is_left_of_a_run_is_not_overwritten(folder, left):
    for path in folder.iterdir():
        if path.name not in (left, ".lock"):
            path.unlink()
    content = (folder / left).read_bytes()
    with pytest.raises(RunError, match=r"another run|but no config.json"):
        evolve(replace(TOY, folder=str(folder), seed=1), simulate=toys.bowl)
    assert (folder / left).read_bytes() == content


def test_only_one_process_and_thread_writes(folder):
    program = (
        f"from evolution._src.search.run import RunFolder\nwith RunFolder({str(folder)!r}).lock():\n"
        "    print('held', flush=True)\n    input()"
    )
    command = [sys.executable, "-c", program]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    errors = []

    def write() -> None:
        with pytest.raises(RunError, match="being written by another run") as caught:
            resume(folder, simulate=toys.bowl)
        errors.append(caught)

    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        write()
        assert len(load_run(folder).history) == 3
    finally:
        process.kill()
        process.communicate()
    with RunFolder(folder).lock():
        thread = threading.Thread(target=write)
        thread.start()
        thread.join()
    assert len(errors) == 2
    assert len(resume(folder, generations=4, simulate=toys.bowl).history) == 4


def test_a_config_that_contradicts_the_record_is_refused(folder):
    content = json.loads((folder / "config.json").read_text())
    content["config"]["sigma"] = 0.7
    (folder / "config.json").write_text(json.dumps(content))
    with pytest.raises(RunError, match="belongs to another configuration"):
        resume(folder, simulate=toys.bowl)


@pytest.mark.slow
def test_a_flipped_bit_gives_the_same_record_or_a_clear_error(finished):
    content = (finished / "record.npz").read_bytes()
    record, digest = Record.from_bytes(content, "record.npz")
    refused = []
    for damaged in flip_bits(content, 600):
        try:
            found, found_digest = Record.from_bytes(damaged, "record.npz")
        except RunError as error:
            refused.append(str(error))
            continue
        assert found_digest == digest
        assert found.to_bytes(digest) == record.to_bytes(digest)
    assert len(refused) > 300
    assert all("record.npz" in message for message in refused)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        *(("config.json", text) for text in ("", "[]", "{}", '{"config": {"wings": 2}}')),
        ("config.json", '{"config": {"modules": "eight"}}'),
        ("record.npz", "PK"),
    ],
)
def test_a_damaged_file_is_a_clear_error_and_stays(folder, name, text):
    (folder / name).write_text(text)
    for action in (load_run, resume):
        with pytest.raises(RunError, match=name):
            action(folder)
    assert (folder / name).read_text() == text


@pytest.mark.parametrize("text", ["", "[]", '{"genotype": [1]}', '{"genotype": [NaN], "names": ["a"]}'])
def test_a_damaged_champion_is_a_clear_error(tmp_path, text):
    (tmp_path / "champion.json").write_text(text)
    with pytest.raises(RunError, match=r"champion\.json"):
        load_champion(tmp_path)


def test_no_run_no_resume(tmp_path):
    for place in (tmp_path, tmp_path / "nowhere"):
        for action in (load_run, resume):
            with pytest.raises(RunError, match="contains no run"):
                action(place)


def test_a_folder_that_cannot_be_written_is_a_clear_error(folder, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="cannot be written"):
        evolve(replace(TOY, folder=str(tmp_path / "file" / "run")), simulate=toys.bowl)

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
    assert len(load_run(folder).history) >= 3
    assert len(resume(folder, generations=8, simulate=toys.bowl).history) == 8


@pytest.mark.parametrize("left", [(), ("history.csv", "champion.json")])
def test_a_run_that_lost_its_record_is_refused(folder, left):
    for name in {"record.npz", "history.csv", "champion.json"} - set(left):
        (folder / name).unlink()
    before = sorted(folder.iterdir())
    for read in (resume, load_run):
        with pytest.raises(RunError, match=r"record\.npz is missing, .*restore it"):
            read(folder)
    assert sorted(folder.iterdir()) == before


@pytest.mark.slow
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
        assert {path.name for path in folder.iterdir()} - {".lock"} == set(FILES)


@pytest.mark.parametrize("name", FILES)
def test_a_run_folder_leads_nowhere_else(folder, tmp_path, name):
    """Somebody else's folder may hold links to anything."""
    elsewhere = tmp_path / "elsewhere"
    (folder / name).rename(elsewhere)
    content = elsewhere.read_bytes()
    (folder / name).symlink_to(elsewhere)
    with pytest.raises(RunError, match=rf"{name} is a link"):
        resume(folder, generations=5, simulate=toys.bowl)
    assert elsewhere.read_bytes() == content


def test_a_record_that_is_no_file_is_not_read(folder):
    (folder / "record.npz").unlink()
    (folder / "record.npz").symlink_to(os.devnull)
    with pytest.raises(RunError, match=r"record\.npz is no regular file"):
        load_run(folder)
