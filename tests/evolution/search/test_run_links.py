"""A run folder from somebody else may hold links: nothing is written or read through them."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
import toys

from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run, resume

TOY = EvolutionConfig(arena="truth", generations=3, stop_when_solved=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    evolve(replace(TOY, folder=str(tmp_path / "run")), simulate=toys.bowl)
    return tmp_path / "run"


@pytest.mark.parametrize("name", ["config.json", "record.npz", "history.csv", "champion.json"])
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
