"""The cache folder: the user's own, and never one that others could have filled."""

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


def test_the_fallback_is_a_private_folder_of_the_process(shared: Path, caplog) -> None:
    folder = cache.find_cache_folder("arenas")
    assert folder == cache.find_cache_folder("arenas")
    assert folder.parent.parent == shared
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    assert ["cannot be written" in record.getMessage() for record in caplog.records] == [True]
