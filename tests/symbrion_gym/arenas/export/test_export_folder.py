"""The folder of an export: complete, described, and careful with the files of others."""

import json

import numpy as np
import pytest
from exported import make_field_arena, make_mixed_arena

from symbrion_gym._src.arenas.export import export
from symbrion_gym._src.arenas.export.export import MANIFEST
from symbrion_gym._src.errors import ArenaError


def read_all(folder) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("to", ["mjcf", "urdf", "obj"])
def test_every_export_says_what_it_is(tmp_path, to):
    arena = make_mixed_arena()
    about = arena.export(tmp_path / "out", to)
    stored = json.loads((tmp_path / "out" / MANIFEST).read_text())
    assert stored == {"format": 1, **about, "complete": True, "files": sorted(read_all(tmp_path / "out"))}
    assert stored["units"] == "m"
    assert stored["up"] == "z"
    assert stored["friction"] == 0.6
    assert stored["offset"] == [0.0, 0.0, 0.0]
    assert stored["generator"].startswith("symbrion-gym ")
    readme, notice = ((tmp_path / "out" / name).read_text() for name in ("README.md", "NOTICE.txt"))
    assert "friction of the ground: 0.6" in readme
    assert "terms of the owner of the scan" in " ".join(notice.split())


def test_heights_are_those_of_the_surface(tmp_path):
    arena = make_field_arena()
    arena.export(tmp_path, "mjcf")
    with np.load(tmp_path / "heights.npz") as file:
        heights, low, high = file["heights"], file["low"], file["high"]
    rows, columns = heights.shape
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    inner = (slice(1, -1), slice(1, -1))
    assert np.allclose(heights[inner], arena.height(x, y)[inner], atol=1e-6)
    assert columns > rows > 40


def test_a_second_export_replaces_the_first_and_nothing_else(tmp_path):
    arena = make_mixed_arena()
    arena.export(tmp_path, "urdf")
    (tmp_path / "pieces/notes.txt").write_text("mine")
    (tmp_path / "notes.txt").write_text("mine")
    arena.export(tmp_path, "obj")
    assert set(read_all(tmp_path)) == {
        *("contact.obj", "surface.obj", "heights.npz", "README.md", "NOTICE.txt", MANIFEST),
        *("pieces/notes.txt", "notes.txt"),
    }
    arena.export(tmp_path, "urdf")
    assert (tmp_path / "pieces/notes.txt").read_text() == "mine"


def test_a_folder_of_something_else_is_refused(tmp_path):
    arena = make_mixed_arena()
    arena.save(tmp_path / "arena")
    before = read_all(tmp_path)
    with pytest.raises(ArenaError, match="is not empty and holds no export; choose another folder"):
        arena.export(tmp_path / "arena", "mjcf")
    with pytest.raises(ArenaError, match="is a file"):
        arena.export(tmp_path / "arena/arena.json", "mjcf")
    assert read_all(tmp_path) == before


@pytest.mark.parametrize("content", ["{}", "[]", "nonsense", '{"format": "x", "files": []}', '{"format": 1}'])
def test_a_manifest_of_another_program_is_refused(tmp_path, content):
    (tmp_path / MANIFEST).write_text(content)
    with pytest.raises(ArenaError, match="damaged or of another program"):
        make_mixed_arena().export(tmp_path, "mjcf")
    assert read_all(tmp_path) == {MANIFEST: content.encode()}


def test_a_kill_between_two_files_is_repaired_by_the_next_export(tmp_path, monkeypatch):

    arena = make_mixed_arena()
    arena.export(tmp_path, "urdf")
    write, calls = export.write_file, []

    def write_three(path, content):
        if len(calls) == 3:
            raise KeyboardInterrupt
        calls.append(path)
        write(path, content)

    monkeypatch.setattr(export, "write_file", write_three)
    with pytest.raises(KeyboardInterrupt):
        arena.export(tmp_path, "mjcf")
    assert json.loads((tmp_path / MANIFEST).read_text())["complete"] is False
    monkeypatch.undo()
    arena.export(tmp_path, "obj")
    assert set(read_all(tmp_path)) == set(json.loads((tmp_path / MANIFEST).read_text())["files"])
