"""The commit of a checkout, and never that of a repository that merely contains the code."""

import subprocess
from pathlib import Path

import pytest

from evolution._src.search.stored_config import find_revision

ROOT = Path(__file__).parents[3]


def git(folder: Path, *words: str) -> str:
    command = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@b", *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def write_project(root: Path, name: str = "symbrion-gym") -> Path:
    """Write a package at a root; return its file."""
    file = root / "evolution" / "provenance.py"
    file.parent.mkdir(parents=True)
    file.write_text("VALUE = 1\n")
    (root / "pyproject.toml").write_text(f'[project]\nname = "{name}"\n')
    return file


def commit_all(root: Path, message: str = "all") -> str:
    if not (root / ".git").exists():
        git(root, "init", "-q")
    git(root, "add", "-A")
    git(root, "commit", "-q", "-m", message)
    return git(root, "rev-parse", "HEAD")


def test_a_checkout_knows_its_commit(tmp_path: Path) -> None:
    file = write_project(tmp_path)
    commit = commit_all(tmp_path)
    revision = find_revision(file)
    assert revision is not None
    assert (revision.commit, revision.is_dirty, str(revision)) == (commit, False, commit[:7])


def test_a_file_two_folders_deep_knows_the_commit(tmp_path: Path) -> None:
    write_project(tmp_path)
    file = tmp_path / "evolution" / "search" / "deep" / "module.py"
    file.parent.mkdir(parents=True)
    file.write_text("VALUE = 1\n")
    commit = commit_all(tmp_path)
    revision = find_revision(file)
    assert revision is not None
    assert revision.commit == commit


def test_only_code_makes_a_checkout_dirty(tmp_path: Path) -> None:
    file = write_project(tmp_path)
    results = tmp_path / "benchmarks" / "results"
    results.mkdir(parents=True)
    (results / "a.json").write_text("{}")
    commit_all(tmp_path)
    (results / "a.json").write_text("[]")
    (tmp_path / "README.md").write_text("new")
    revision = find_revision(file)
    assert revision is not None
    assert not revision.is_dirty
    file.write_text("VALUE = 2\n")
    revision = find_revision(file)
    assert revision is not None
    assert revision.is_dirty
    assert "uncommitted" in str(revision)


def test_the_repository_around_an_environment_says_nothing(tmp_path: Path) -> None:
    """Installed in an ignored `.venv` of somebody else's repository, which is tracked, named and clean."""
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "other"\n')
    (tmp_path / ".gitignore").write_text(".venv\n")
    file = write_project(tmp_path / ".venv" / "lib" / "site-packages")
    commit_all(tmp_path)
    assert find_revision(file) is None


@pytest.mark.parametrize("name", ["symbrion-gym", "other"])
def test_a_copy_that_another_repository_tracks_is_not_ours(tmp_path: Path, name: str) -> None:
    """Vendored in a folder, or at the root of a project of another name."""
    file = write_project(tmp_path / "vendor" if name == "symbrion-gym" else tmp_path, name)
    commit_all(tmp_path)
    assert find_revision(file) is None


def test_a_copy_in_a_subfolder_of_another_repository_is_not_ours(tmp_path: Path) -> None:
    """The other repository tracks the copy, and has a `pyproject.toml` of the same name at its own root."""
    file = write_project(tmp_path / "third_party" / "symbrion")
    deep = file.parent / "search" / "module.py"
    deep.parent.mkdir()
    deep.write_text("VALUE = 1\n")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "symbrion-gym"\n')
    commit_all(tmp_path)
    assert find_revision(file) is None
    assert find_revision(deep) is None


def test_an_ignored_copy_at_the_root_is_not_the_commit(tmp_path: Path) -> None:
    file = write_project(tmp_path)
    (tmp_path / ".gitignore").write_text("evolution\n")
    commit_all(tmp_path)
    assert find_revision(file) is None


def test_a_hook_of_another_repository_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    file = write_project(ours)
    commit = commit_all(ours, "ours")
    write_project(theirs)
    commit_all(theirs, "theirs")
    monkeypatch.setenv("GIT_DIR", str(theirs / ".git"))
    revision = find_revision(file)
    assert revision is not None
    assert revision.commit == commit


def test_without_git_there_is_no_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write_project(tmp_path)
    commit_all(tmp_path)
    monkeypatch.setenv("PATH", "")
    assert find_revision(file) is None
