"""Saving an arena: what is not the arena's stays, and a kill leaves the old arena or the new one."""

import json
import os
import shutil
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from kills import kill_at_each_moment

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.saving import find_own_files
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

FOREIGN = ("notes.txt", "runs/a/record.npz", "pieces/mine.obj", "pieces/099.obj", ".arena/mine.txt")


def make_columns(name: str, count: int) -> Arena:
    """Make an arena of columns in a row, with as many sides as its name has letters."""
    pieces = [trimesh.creation.cylinder(0.5, 1.0, sections=len(name)) for _ in range(count)]
    for index, piece in enumerate(pieces):
        piece.apply_translation((1.5 * index, 0, 0))
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=count)
    return Arena(name, pieces, trimesh.util.concatenate(pieces), quality)


OLD, NEW = make_columns("old", 3), make_columns("newer", 2)


@pytest.fixture(autouse=True)
def lame_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing here waits for the disk."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the old arena and things of the user."""
    OLD.save(tmp_path / "mine")
    for name in FOREIGN:
        path = tmp_path / "mine" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"my {name}")
    return tmp_path / "mine"


def list_files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}


def check_foreign(folder: Path) -> None:
    for name in FOREIGN:
        assert (folder / name).read_text() == f"my {name}"


def check_whole(folder: Path, *allowed: Arena) -> None:
    """Check that a folder holds one of some arenas, and MuJoCo one of them, too."""
    loaded = Arena.load(folder)
    expected = {arena.name: arena for arena in allowed}[loaded.name]
    assert len(loaded.pieces) == len(expected.pieces)
    for piece, wanted in zip(
        [*loaded.pieces, loaded.surface], [*expected.pieces, expected.surface], strict=True
    ):
        np.testing.assert_allclose(piece.vertices, wanted.vertices, atol=1e-4)
    # MuJoCo's cache takes files of one path and second for equal.
    with tempfile.TemporaryDirectory() as place:
        copied = shutil.copytree(folder, Path(place) / "copied")
        model = mujoco.MjModel.from_xml_path(str(copied / "arena.xml"))
    shown = {f"arena {arena.name}": arena for arena in allowed}[model.names.split(b"\0")[0].decode()]
    assert model.ngeom == len(shown.pieces) + 1
    assert model.nmeshvert == sum(len(mesh.vertices) for mesh in (*shown.pieces, shown.surface))


OWN_NEW = {"arena.json", "arena.xml", "surface.obj", "pieces/000.obj", "pieces/001.obj"}


def test_only_the_arenas_own_files_are_replaced(folder: Path) -> None:
    NEW.save(folder)
    check_foreign(folder)
    check_whole(folder, NEW)
    assert list_files(folder) == OWN_NEW | set(FOREIGN)
    about = json.loads((folder / "arena.json").read_text())
    assert set(about["files"]) == OWN_NEW


@pytest.mark.parametrize("about", [None, "", "{}", '{"format": 1}', '{"format": 99, "files": []}'])
def test_a_folder_of_something_else_is_refused_untouched(tmp_path: Path, about: str | None) -> None:
    (tmp_path / "surface.obj").write_text("mine")
    if about is not None:
        (tmp_path / "arena.json").write_text(about)
    before = list_files(tmp_path)
    with pytest.raises(ArenaError, match="choose another folder"):
        NEW.save(tmp_path)
    assert list_files(tmp_path) == before
    assert (tmp_path / "surface.obj").read_text() == "mine"


def test_an_edited_manifest_leads_nowhere_else(folder: Path) -> None:
    outside = folder.parent / "outside.obj"
    outside.write_text("outside")
    about = json.loads((folder / "arena.json").read_text())
    names = ["../outside.obj", str(outside), "notes.txt", "pieces/../notes.txt", "pieces", 7, None, ""]
    (folder / "arena.json").write_text(json.dumps({**about, "files": about["files"] + names}))
    NEW.save(folder)
    check_foreign(folder)
    assert outside.read_text() == "outside"
    assert list_files(folder) == OWN_NEW | set(FOREIGN)


def test_a_foreign_file_of_a_wanted_name_is_in_the_way(tmp_path: Path) -> None:
    NEW.save(tmp_path)
    (tmp_path / "pieces" / "002.obj").write_text("mine")
    with pytest.raises(ArenaError, match=r"002\.obj is in the way"):
        OLD.save(tmp_path)
    assert (tmp_path / "pieces" / "002.obj").read_text() == "mine"
    check_whole(tmp_path, NEW)


@pytest.mark.parametrize("name", ["pieces", ".arena", "surface.obj", "arena.xml", "pieces/000.obj"])
def test_links_are_not_followed_out_of_the_folder(tmp_path: Path, name: str) -> None:
    folder, outside = tmp_path / "mine", tmp_path / "outside"
    OLD.save(folder)
    if (folder / name).exists():
        (folder / name).rename(outside)
    else:
        outside.mkdir()
    (folder / name).symlink_to(outside)
    before = list_files(tmp_path)
    with pytest.raises(ArenaError, match="in the way"):
        NEW.save(folder)
    assert list_files(tmp_path) == before
    if name in ("pieces", "surface.obj", "pieces/000.obj"):
        with pytest.raises(ArenaError, match="is a link to elsewhere"):
            Arena.load(folder)


@pytest.mark.slow
def test_a_kill_leaves_the_old_arena_or_the_new_one(folder: Path) -> None:
    kept = folder.rename(folder.with_name("kept"))

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(kept, folder)

    names = set()
    for _ in kill_at_each_moment(prepare, lambda: NEW.save(folder)):
        check_foreign(folder)
        check_whole(folder, OLD, NEW)
        names.add(Arena.load(folder).name)
        NEW.save(folder)
        check_foreign(folder)
        check_whole(folder, NEW)
        assert list_files(folder) == OWN_NEW | set(FOREIGN)
    assert names == {"old", "newer"}


@pytest.mark.slow
@pytest.mark.parametrize("exists", [True, False])
def test_a_kill_leaves_no_arena_or_a_whole_one(tmp_path: Path, exists: bool) -> None:
    folder = tmp_path / "new"

    def prepare() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        if exists:
            folder.mkdir()

    outcomes = set()
    for _ in kill_at_each_moment(prepare, lambda: NEW.save(folder)):
        outcomes.add((folder / "arena.json").exists())
        if (folder / "arena.json").exists():
            assert Arena.load(folder).name == NEW.name
            assert len(Arena.load(folder).pieces) == 2
        else:
            assert list_files(folder) == {name for name in list_files(folder) if name.startswith(".arena")}
        OLD.save(folder)
        check_whole(folder, OLD)
        assert list_files(folder) == OWN_NEW | {"pieces/002.obj"}
    assert outcomes == {False, True}


def test_shipped_arenas_are_known_as_such(tmp_path: Path) -> None:
    source = Path(__file__).parents[3] / "assets" / "arenas" / "gsrm"
    own = find_own_files(source)
    assert own.names == list_files(source)


def test_a_disk_without_links_holds_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    OLD.save(tmp_path / "linked")
    monkeypatch.setattr(os, "link", lambda *_, **__: os.stat(tmp_path / "none"))
    OLD.save(tmp_path / "written")
    names = list_files(tmp_path / "linked")
    assert names == list_files(tmp_path / "written")
    for name in names:
        assert (tmp_path / "linked" / name).read_bytes() == (tmp_path / "written" / name).read_bytes()
