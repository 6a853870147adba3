"""The cache folder: the user's own, and never one that others could have filled."""

import os
import stat
import tempfile
from pathlib import Path

import pytest

from reconstruction._src.base import cache


@pytest.fixture
def shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A temporary folder shared by all users, where no other place can be written."""
    blocked, shared = tmp_path / "file", tmp_path / "tmp"
    blocked.write_text("")
    shared.mkdir()
    monkeypatch.setenv(cache.CACHE_VARIABLE, str(blocked / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(shared))
    cache._make_private_folder.cache_clear()
    return shared


def test_the_wanted_folder_is_taken_where_it_can_be_written(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv(cache.CACHE_VARIABLE, str(tmp_path / "mine"))
    assert cache.find_cache_folder("arenas") == tmp_path / "mine" / "arenas"


def test_the_fallback_is_private_and_found_again(shared: Path, caplog) -> None:
    folder = cache.find_cache_folder("arenas")
    assert folder == cache.find_cache_folder("arenas")
    assert folder.parent.parent == shared
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    assert not caplog.records


def make_open_to_all(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)


def make_open_to_group(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o770)


def make_link(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(folder.parent / "elsewhere")


@pytest.mark.parametrize("prepare", [make_open_to_all, make_open_to_group, make_link, Path.touch])
def test_a_folder_that_others_can_fill_is_not_used(shared: Path, caplog, prepare) -> None:
    taken = shared / f"symbrion-gym-{os.getuid()}"
    prepare(taken)
    folder = cache.find_cache_folder("arenas")
    assert folder.parent != taken
    assert folder.resolve().parent.parent == shared.resolve()
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    assert folder == cache.find_cache_folder("arenas")
    assert [str(taken) in record.getMessage() for record in caplog.records] == [True]


def test_a_folder_of_another_user_is_not_used(shared: Path, monkeypatch, caplog) -> None:
    other_user = os.getuid() + 1
    (shared / f"symbrion-gym-{other_user}").mkdir(mode=0o700)
    monkeypatch.setattr(os, "getuid", lambda: other_user)
    assert cache.find_cache_folder("arenas").parent != shared / f"symbrion-gym-{other_user}"
    assert "not this user's alone" in caplog.text
