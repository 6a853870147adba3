"""Folders of commands that make many files."""

from pathlib import Path

import pytest

from evolution._src.errors import RunError
from evolution._src.experiments.demo import refuse_foreign_files


def test_its_own_folder_and_a_fresh_one_pass(tmp_path: Path) -> None:
    refuse_foreign_files(tmp_path / "fresh", "mark.json", ["arenas"])
    (tmp_path / "mark.json").write_text("{}")
    (tmp_path / "arenas").mkdir()
    refuse_foreign_files(tmp_path, "mark.json", ["arenas"])


def test_a_folder_without_the_mark_is_refused(tmp_path: Path) -> None:
    (tmp_path / "arenas").mkdir()
    with pytest.raises(RunError, match=r"contains arenas, .* no mark\.json"):
        refuse_foreign_files(tmp_path, "mark.json", ["arenas"])


@pytest.mark.parametrize("is_there", [True, False], ids=["to a folder", "to nothing"])
def test_a_link_is_refused_even_in_its_own_folder(tmp_path: Path, is_there: bool) -> None:
    own, elsewhere = tmp_path / "own", tmp_path / "elsewhere"
    own.mkdir()
    if is_there:
        elsewhere.mkdir()
    (own / "mark.json").write_text("{}")
    (own / "arenas").symlink_to(elsewhere)
    with pytest.raises(RunError, match="arenas is a link"):
        refuse_foreign_files(own, "mark.json", ["arenas"])
