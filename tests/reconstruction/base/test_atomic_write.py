"""A file appears whole or not at all."""

import contextlib
import os
import resource
from pathlib import Path

import numpy as np
import pytest

from reconstruction._src.base.atomic_write import find_leftovers, write_atomically


def test_the_file_is_replaced_and_the_old_one_readable_until_then(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with write_atomically(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_after_an_error_nothing_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail() -> None:
        with write_atomically(path) as temporary:
            temporary.write_text("half")
            raise KeyError("x")

    with pytest.raises(KeyError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_was_written_is_on_the_disk_before_the_rename(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: done.append("flush"))
    rename = os.replace
    monkeypatch.setattr(os, "replace", lambda *names: (done.append("rename"), rename(*names)))
    with write_atomically(tmp_path / "a.txt") as temporary:
        temporary.write_text("new")
    assert done == ["flush", "rename"]


@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_others_may_read_what_the_umask_allows(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        with write_atomically(tmp_path / "a.npz") as temporary:
            np.savez(temporary, a=np.zeros(3))
    finally:
        os.umask(before)
    assert (tmp_path / "a.npz").stat().st_mode & 0o777 == 0o666 & ~umask


def test_a_file_keeps_its_mode(tmp_path: Path) -> None:
    path = tmp_path / "private.txt"
    path.touch(mode=0o600)
    with write_atomically(path) as temporary:
        temporary.write_text("new")
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_link_is_replaced_and_what_it_leads_to_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "a.txt").write_text("old")
    for target in ("far/a.txt", "far/b.txt"):
        (tmp_path / "a.txt").unlink(missing_ok=True)
        (tmp_path / "a.txt").symlink_to(target)
        with write_atomically(tmp_path / "a.txt") as temporary:
            temporary.write_text("new")
        assert not (tmp_path / "a.txt").is_symlink()
    assert [(path.name, path.read_text()) for path in (tmp_path / "far").iterdir()] == [("a.txt", "old")]


def test_two_writers_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with write_atomically(path) as first, write_atomically(path) as second:
        first.write_text("first")
        second.write_text("second")
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]


def test_folders_devices_and_protected_files_are_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.mkfifo(tmp_path / "pipe")
    protected = tmp_path / "protected"
    protected.write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != protected)  # root may write anything
    for path in (tmp_path, tmp_path / "pipe", protected):
        with pytest.raises(OSError, match=path.name), write_atomically(path):
            raise AssertionError("never begun")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["pipe", "protected"]


def test_a_full_disk_error_names_the_file_itself(tmp_path: Path) -> None:
    """A limit on the size of files stands for the disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OSError, match=r"a\.bin'$"), write_atomically(tmp_path / "a.bin") as temporary:
            temporary.write_bytes(bytes(5000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


def test_leftovers_of_killed_writers_are_found(tmp_path: Path) -> None:
    names = ("a+b.tar.npz", "c", ".lock")
    with contextlib.ExitStack() as stack:
        temporaries = {stack.enter_context(write_atomically(tmp_path / name)): name for name in names}
        for path in (*temporaries, tmp_path / ".mine.part.npz", tmp_path / "c"):
            path.touch()
        assert find_leftovers(tmp_path) == temporaries
    assert find_leftovers(tmp_path) == find_leftovers(tmp_path / "nowhere") == {}
