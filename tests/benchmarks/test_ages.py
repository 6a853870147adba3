"""Figures are old once the code that they measure has changed, and only then."""

import subprocess
from pathlib import Path

import pytest

from benchmarks.ages import ROOT, normalize, open_ages
from benchmarks.claims import CLAIMS, LIMITS
from benchmarks.claims.sources import SOURCES, find_sources

CODE = '''"""What it is."""

LIMIT = 3


def measure(x):
    """Measure."""
    return x + LIMIT  # a comment


def show(x):
    print(x)
'''


def git(folder: Path, *words: str) -> str:
    command = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@b", *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def commit(root: Path) -> str:
    git(root, "add", "-A")
    git(root, "commit", "-q", "--allow-empty", "-m", "next")
    return git(root, "rev-parse", "HEAD")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A checkout with one commit."""
    root = tmp_path / "clone"
    for name in ("scans/a.py", "scans/b.py", "other/c.py"):
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(CODE)
    (root / "README.md").write_text("figures\n")
    git(root, "init", "-q")
    commit(root)
    return root


def is_old(root: Path, since: str, *sources: str) -> bool | None:
    ages = open_ages(root)
    assert ages is not None
    return ages.is_old(since, sources)


def test_a_row_is_old_once_its_code_has_changed(root: Path) -> None:
    measured = git(root, "rev-parse", "HEAD")
    assert is_old(root, measured, "scans", "other/c.py") is False
    (root / "scans" / "a.py").write_text(CODE.replace("LIMIT = 3", "LIMIT = 4"))
    assert is_old(root, measured, "scans") is True, "the table is made before the commit"
    after = commit(root)
    assert is_old(root, measured, "scans") is True
    assert is_old(root, measured, "scans/a.py") is True
    assert is_old(root, measured, "scans/b.py", "other") is False
    assert is_old(root, after, "scans") is False
    (root / "scans" / "a.py").write_text(CODE)
    commit(root)
    assert is_old(root, measured, "scans") is False, "the code is what was measured once more"


def test_words_formatting_and_documentation_make_nothing_old(root: Path) -> None:
    measured = git(root, "rev-parse", "HEAD")
    words = CODE.replace("# a comment", "").replace('"""Measure."""', '"""Measure it well."""')
    (root / "scans" / "a.py").write_text(words.replace("LIMIT = 3", "LIMIT = (\n    3\n)"))
    (root / "README.md").write_text("other figures\n")
    (root / "scans" / "notes.md").write_text("notes\n")
    commit(root)
    assert is_old(root, measured, "scans", "other") is False


def test_files_that_come_and_go_count(root: Path) -> None:
    measured = git(root, "rev-parse", "HEAD")
    (root / "scans" / "new.py").write_text("VALUE = 1\n")
    assert is_old(root, measured, "scans") is True
    (root / "scans" / "new.py").unlink()
    assert is_old(root, measured, "scans") is False
    (root / "other" / "c.py").unlink()
    commit(root)
    assert is_old(root, measured, "other") is True


def test_one_definition_of_a_file_may_count(root: Path) -> None:
    measured = git(root, "rev-parse", "HEAD")
    (root / "scans" / "a.py").write_text(CODE.replace("print(x)", "print(x, x)"))
    assert is_old(root, measured, "scans/a.py::measure", "scans/a.py::LIMIT") is False
    assert is_old(root, measured, "scans/a.py::show") is True


def test_a_commit_that_is_not_there_leaves_the_age_unknown(root: Path) -> None:
    assert is_old(root, "0" * 40, "scans") is None


def test_only_a_whole_history_tells_ages(root: Path, tmp_path: Path) -> None:
    commit(root)
    git(tmp_path, "clone", "-q", "--depth", "1", f"file://{root}", "shallow")
    assert open_ages(tmp_path / "shallow") is None
    assert open_ages(root / "scans") is None, "not the top of a checkout"
    assert open_ages(tmp_path) is None


def test_what_is_no_python_is_compared_as_it_is() -> None:
    assert normalize("not: python:") == "not: python:"
    assert normalize("class A:\n    '''Words.'''\n    x: int = 1\n    '''More.'''\n") == normalize(
        "class A:\n    x: int = 1\n"
    )


def test_every_place_of_code_is_there() -> None:
    """Where code moves, its name moves along; else no change would be seen."""
    claimed = {source for claim in (*CLAIMS, *LIMITS) for source in claim.sources}
    for source in claimed | {source for sources in SOURCES.values() for source in sources}:
        path, _, name = source.partition("::")
        assert (ROOT / path).exists(), source
        if name:
            assert normalize((ROOT / path).read_text(), name) != normalize(""), source


def test_the_longest_key_names_the_code_of_a_part() -> None:
    assert find_sources("evolution", "models/gg 210") == SOURCES["evolution/models"]
    assert find_sources("evolution", "champions") == SOURCES["evolution"]
    with pytest.raises(KeyError, match="moon"):
        find_sources("moon", "phases")
