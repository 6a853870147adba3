"""Folders of commands that make many files."""

from pathlib import Path

import pytest

from evolution._src.errors import RunError
from evolution._src.experiments.folders import claim_folder, refuse_foreign_files
from evolution._src.search.run import lock_folder

OUTPUTS = ("film.mp4",)


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


def test_a_folder_of_other_options_or_files_is_refused(tmp_path: Path) -> None:
    claim_folder(tmp_path / "a", "mark.json", {"seed": 1, "start": (1.0, 2.0)}, OUTPUTS)
    (tmp_path / "a" / "film.mp4").write_bytes(b"ours")
    claim_folder(tmp_path / "a", "mark.json", {"seed": 1, "start": (1.0, 2.0)}, OUTPUTS)
    with pytest.raises(RunError, match=r"describes other options \(seed\)"):
        claim_folder(tmp_path / "a", "mark.json", {"seed": 2, "start": (1.0, 2.0)}, OUTPUTS)
    (tmp_path / "a" / "mark.json").write_text("{")
    with pytest.raises(RunError, match=r"mark\.json.*name another folder"):
        claim_folder(tmp_path / "a", "mark.json", {"seed": 1}, OUTPUTS)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "film.mp4").write_bytes(b"mine")
    with pytest.raises(RunError, match="would be overwritten"):
        claim_folder(tmp_path / "b", "mark.json", {}, OUTPUTS)


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    with lock_folder(tmp_path), pytest.raises(RunError, match="another run"), lock_folder(tmp_path):
        pass
