"""Commands overwrite only their own files, and after a kill there is the old or the new file."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from kills import kill_at_each_moment

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.cli.main import run
from evolution._src.experiments.paper import OUTPUTS
from evolution._src.experiments.train import OUTPUTS as TRAIN_OUTPUTS
from evolution._src.report.page import Page
from reconstruction._src.base.typed_json import write_json


def put_user_file(folder, name):
    """Put a file of the user's where a command would write a file or a folder."""
    path = folder / name / "notes.txt" if "." not in name else folder / name
    path.parent.mkdir(parents=True)
    path.write_text("mine")
    return path


def read_all(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("command", "name"),
    [*((("demo",), name) for name in TRAIN_OUTPUTS), *((("paper", "--quick"), name) for name in OUTPUTS)],
)
def test_other_files_are_not_overwritten(tmp_path, command: tuple[str, ...], name, capsys):
    put_user_file(tmp_path / "x", name)
    before = read_all(tmp_path)
    assert run([*command, "--out", str(tmp_path / "x")]) == 1
    error = capsys.readouterr().err
    assert name in error
    assert "name another folder" in error
    assert read_all(tmp_path) == before


def test_arenas_replace_only_arenas(tmp_path, capsys):
    mesh = tmp_path / "m.ply"
    trimesh.creation.box().export(mesh)
    put_user_file(tmp_path / "x", "gsrm")
    before = read_all(tmp_path)
    assert run(["arena", str(mesh), "--out", str(tmp_path / "x" / "gsrm")]) == 2
    assert "holds no arena; choose another folder" in capsys.readouterr().err
    assert read_all(tmp_path) == before


@pytest.mark.parametrize(("command", "name"), [("survey", "survey.npz"), ("reconstruct", "surface.npz")])
@pytest.mark.parametrize("is_archive", [True, False])
def test_a_default_name_replaces_no_other_file(tmp_path, command, name, is_archive, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    np.savetxt("cloud.xyz", np.random.default_rng(0).uniform(size=(50, 3)))
    if is_archive:
        np.savez(name, heights=np.zeros(3))
    else:
        Path(name).write_text("mine")
    before = read_all(tmp_path)
    assert run([command, "truth" if command == "survey" else "cloud.xyz"]) == 2
    assert f"{name} exists and was not written by this command" in capsys.readouterr().err
    assert read_all(tmp_path) == before


def test_a_scan_is_not_replaced_by_its_surface(tmp_path, capsys):
    scan = tmp_path / "scan.ply"
    rc.save_points(scan, np.random.default_rng(0).uniform(size=(50, 3)))
    before = read_all(tmp_path)
    assert run(["reconstruct", str(scan), "--out", f"{tmp_path}/../{tmp_path.name}/scan.ply"]) == 2
    assert "is the scan itself" in capsys.readouterr().err
    assert read_all(tmp_path) == before


@pytest.mark.parametrize("words", [["survey", "truth"], ["reconstruct", "cloud.xyz"]])
def test_a_folder_is_never_replaced_by_a_file(tmp_path, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cloud.xyz").write_text("0 0 0\n0 0 1\n0 1 0\n")
    put_user_file(tmp_path, "out.npz/notes.txt")
    assert run([*words, "--out", "out.npz"]) == 2
    assert (tmp_path / "out.npz" / "notes.txt").read_text() == "mine"


def make_log(value):
    return rc.ScanLog(np.full((2, 3), value), np.arange(3.0), np.stack([np.eye(4)] * 2))


def make_page(text):
    page = Page(text)
    page.add_text(text)
    return page


WRITERS = {
    "scan log": (lambda path, which: make_log(which).save(path), "a.npz"),
    "points": (lambda path, which: rc.save_points(path, np.full((4, 3), float(which))), "a.ply"),
    "page": (lambda path, which: make_page(f"page {which}").write(path), "a.html"),
    "record of an experiment": (lambda path, which: write_json(path, {"figures": which}), "a.json"),
}


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("exists", [True, False])
def test_a_kill_leaves_the_old_file_or_the_new_one(tmp_path, kind, exists, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    write, name = WRITERS[kind]
    path = tmp_path / name
    write(path, 2)
    new = path.read_bytes()
    write(path, 1)
    old = path.read_bytes() if exists else None

    def prepare() -> None:
        path.unlink() if old is None else path.write_bytes(old)

    seen = set()
    for _ in kill_at_each_moment(lambda: path.exists() and prepare(), lambda: write(path, 2)):
        seen.add(path.read_bytes() if path.exists() else None)
    assert seen == {old, new}


PROGRAM = "import sys; from evolution._src.cli.main import main; main(sys.argv[1:])"
KILLS = 3


@pytest.mark.slow
@pytest.mark.parametrize("command", ["arena", "survey", "reconstruct"])
def test_commands_killed_while_they_write(tmp_path, command):
    """Signal 9 comes a random moment after the first change in the folder."""
    box = trimesh.creation.box((2, 2, 0.3))
    box.export(tmp_path / "box.ply")
    rc.save_points(tmp_path / "cloud.xyz", np.random.default_rng(0).uniform(size=(400, 3)))
    out = tmp_path / "out" / {"arena": "a", "survey": "a.npz", "reconstruct": "a.npz"}[command]
    words = {
        "arena": ["arena", "box.ply", "--kind", "prisms"],
        "survey": ["survey", "truth", "--speed", "5", "--beams", "31"],
        "reconstruct": ["reconstruct", "cloud.xyz", "--units", "30", "--raw"],
    }[command]
    out.parent.mkdir()
    rng = random.Random(0)
    for _ in range(KILLS):
        before = _list(out.parent)
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *words, "--out", str(out), "--quiet", "--json"],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
            stdout=subprocess.DEVNULL,
        )
        while process.poll() is None and _list(out.parent) == before:
            time.sleep(0.002)
        time.sleep(10 ** rng.uniform(-4, 0))
        process.send_signal(signal.SIGKILL)
        assert process.wait() in (0, -signal.SIGKILL)
        if command == "arena":
            if (out / "arena.json").exists():
                assert len(sg.Arena.load(out).pieces) == len(box.faces)
        elif out.exists():
            (rc.load_scan_log if command == "survey" else rc.Reconstruction.load)(out)


def _list(folder):
    found = []
    for path in sorted(folder.rglob("*")):
        try:
            found.append((str(path), path.stat().st_mtime_ns))
        except FileNotFoundError:
            continue
    return found
