"""Which commit of this project the running code is, where it runs from a checkout."""

import os
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

PROJECT = "symbrion-gym"
"""Name in the `pyproject.toml` at the root of a checkout."""
CODE = ("reconstruction", "symbrion_gym", "evolution", "benchmarks", "assets", ":(exclude)benchmarks/results")
"""Paths that decide results; a change elsewhere (documentation, tests, results) leaves a checkout clean."""


@dataclass(frozen=True)
class Revision:
    """A state of the project's code.

    Attributes:
        commit: its hash.
        is_dirty: whether the code differs from that commit.
    """

    commit: str
    is_dirty: bool

    def __str__(self) -> str:
        """Return a short form for people."""
        return self.commit[:7] + (" with uncommitted changes" if self.is_dirty else "")


def find_revision(file: str | Path = __file__) -> Revision | None:
    """Return the commit that a file of a package of this project stands at."""
    file = Path(file).resolve()
    root = next((folder for folder in file.parents if (folder / "pyproject.toml").is_file()), None)
    if root is None:
        return None
    top = run_git(root, "rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != root or _read_project(root) != PROJECT:
        return None
    is_tracked = run_git(root, "ls-files", "--error-unmatch", "--", str(file)) is not None
    commit = run_git(root, "rev-parse", "--verify", "HEAD") if is_tracked else None
    return Revision(commit, bool(run_git(root, "status", "--porcelain", "--", *CODE))) if commit else None


def run_git(folder: Path, *words: str) -> str | None:
    """Return what a git command prints in a folder; None where it fails or there is no git.

    Variables such as `GIT_DIR`, which a hook of another repository sets, do not count.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    command = ["git", "-C", str(folder), *words]
    try:
        done = subprocess.run(command, capture_output=True, check=True, timeout=60, env=environment)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.decode(errors="surrogateescape").strip()


def _read_project(root: Path) -> str | None:
    try:
        return tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["name"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
