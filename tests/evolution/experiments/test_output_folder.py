"""Folders of commands that make many files."""

from pathlib import Path

import pytest

from evolution._src.errors import RunError
from evolution._src.experiments.demo import refuse_foreign_files


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
