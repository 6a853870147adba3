"""The steps of the Makefile for any platform: `python tools/make.py demo` does what `make demo` does.

Only the standard library is needed. The steps stand here; the Makefile calls this script.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VENV = ".venv"
PINS = ("pyproject.toml", "constraints.txt")
"""What decides which packages are installed: where one is newer than the installation, it is repeated."""
LEFTOVERS = (VENV, "demo", "paper", "site", "build", "dist", "mutants")
MINIMUM = (3, 11)


@dataclass(frozen=True)
class Target:
    """A step.

    Attributes:
        text: one line of help.
        commands: words after the environment's Python, one tuple a command; they run in order until one fails.
        extras: optional dependencies that it needs, `dev` aside.
        variables: of the environment.
        is_nice: run at a low priority where the system has `nice`.
    """

    text: str
    commands: tuple[tuple[str, ...], ...] = ()
    extras: tuple[str, ...] = ()
    variables: Mapping[str, str] = field(default_factory=dict)
    is_nice: bool = False


TARGETS = {
    "setup": Target("make .venv and install the package with all tools"),
    "demo": Target(
        "the whole pipeline on a small scale; open demo/report.html",
        (("-m", "evolution", "demo", "--out", "demo"),),
    ),
    "test": Target(
        "the tests, without the slow ones",
        (("-m", "pytest", "-m", "not slow", "-n", "2", "--dist", "loadfile"),),
    ),
    "test-slow": Target("the slow tests", (("-m", "pytest", "-m", "slow"),)),
    "check": Target(
        "style, types, licenses of the dependencies",
        (
            ("-m", "ruff", "check", "."),
            ("-m", "ruff", "format", "--check", "."),
            ("-m", "pyright"),
            ("-m", "tools.licenses"),
        ),
    ),
    "mutants": Target(
        "break the code in small ways and count what no test notices",
        (("-m", "benchmarks.mutants"),),
        extras=("mutants",),
        variables={"OMP_NUM_THREADS": "1"},
        is_nice=True,
    ),
    "bench": Target("every benchmark, then the tables of README and docs", (("-m", "benchmarks"),)),
    "figures": Target(
        "the tables of README and docs, from the results that exist", (("-m", "benchmarks.table"),)
    ),
    "paper": Target("the paper's experiments", (("-m", "evolution", "paper", "--out", "paper"),)),
    "docs": Target(
        "the documentation as a site, site/index.html",
        (("-m", "mkdocs", "build", "--strict", "--quiet"),),
        extras=("docs",),
        variables={"NO_MKDOCS_2_WARNING": "1"},
    ),
    "assets": Target(
        "the ready-made arenas that the package ships",
        (("-m", "evolution", "assets", "--out", "assets/arenas"),),
    ),
    "clean": Target("remove .venv and everything that these steps made"),
}


def find_python(root: Path, platform: str = sys.platform) -> Path:
    """Return the Python of the environment in `.venv`, which may not exist yet."""
    return root / VENV / ("Scripts/python.exe" if platform == "win32" else "bin/python")


def list_setup(
    root: Path, extras: Iterable[str], platform: str = sys.platform
) -> list[tuple[list[str], Path]]:
    """Return the commands that make and fill the environment, each with the file that marks it as done.

    Args:
        root: of the checkout.
        extras: optional dependencies, besides `dev`.
        platform: as `sys.platform` names it.
    """
    python = find_python(root, platform)
    listed = [([sys.executable, "-m", "venv", VENV], python)]
    for extra in ("dev", *extras):
        mark = root / VENV / (".installed" if extra == "dev" else f".installed-{extra}")
        if not _is_current(mark, root):
            words = [
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "-c",
                "constraints.txt",
            ]
            listed.append(([str(python), *words, "-e", f".[{extra}]"], mark))
    return listed[python.exists() :]


def list_commands(
    name: str, root: Path, words: Sequence[str] = (), platform: str = sys.platform
) -> list[list[str]]:
    """Return the commands of a target, without those that make the environment.

    Args:
        name: of the target.
        root: of the checkout.
        words: more words for the target's last command.
        platform: as `sys.platform` names it.
    """
    target = TARGETS[name]
    prefix = ["nice", "-n", "15"] if target.is_nice and platform != "win32" else []
    commands = [[*prefix, str(find_python(root, platform)), *command] for command in target.commands]
    return [*commands[:-1], [*commands[-1], *words]] if commands else []


def run_target(name: str, root: Path = ROOT, words: Sequence[str] = ()) -> int:
    """Run a target, the environment first; return the exit code of the first command that fails, or 0."""
    if name == "clean":
        for folder in LEFTOVERS:
            shutil.rmtree(root / folder, ignore_errors=True)
        return 0
    for command, mark in list_setup(root, TARGETS[name].extras):
        code = _run(command, root, {})
        if code:
            return code
        if mark.name.startswith(".installed"):
            mark.touch()
    for command in list_commands(name, root, words):
        code = _run(command, root, TARGETS[name].variables)
        if code:
            return code
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the target that the command line names, and return the exit code."""
    if sys.version_info < MINIMUM:  # before pip has checked it
        print(f"symbrion-gym needs Python 3.11 or newer; this is {sys.version.split()[0]}", file=sys.stderr)
        return 1
    width = max(map(len, TARGETS))
    parser = argparse.ArgumentParser(
        prog="python tools/make.py",
        description="Run a step of the project; .venv is made first where it is missing or out of date.",
        epilog="\n".join(f"  {name:{width}}  {target.text}" for name, target in TARGETS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("target", choices=TARGETS, metavar="TARGET", help="one of the names below")
    given, words = parser.parse_known_args(arguments)
    if words and len(TARGETS[given.target].commands) == 0:
        parser.error(f"{given.target} takes no more words, got {' '.join(words)}")
    try:
        return run_target(given.target, words=words)
    except KeyboardInterrupt:
        return 130


def _is_current(mark: Path, root: Path) -> bool:
    """Return whether an installation is newer than what decides it."""
    return mark.exists() and all(mark.stat().st_mtime >= (root / name).stat().st_mtime for name in PINS)


def _run(command: Sequence[str], root: Path, variables: Mapping[str, str]) -> int:
    """Run a command in the checkout; return its exit code, above 0 also where a signal ended it."""
    print(" ".join(command), flush=True)
    return abs(subprocess.run(command, cwd=root, env={**os.environ, **variables}, check=False).returncode)


if __name__ == "__main__":
    sys.exit(main())
