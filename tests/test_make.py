"""`tools/make.py`: the steps of the Makefile as commands, for each platform, in the right order."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tools import make

ROOT = Path(__file__).parents[1]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with the two files that decide what is installed."""
    for name in make.PINS:
        (tmp_path / name).write_text("")
        os.utime(tmp_path / name, (1e9, 1e9))
    return tmp_path


def fill(checkout: Path, platform: str) -> None:
    """Make what a finished installation leaves."""
    python = make.find_python(checkout, platform)
    python.parent.mkdir(parents=True)
    python.touch()
    (checkout / ".venv" / ".installed").touch()


@pytest.mark.parametrize(
    ("platform", "python"),
    [("linux", "bin/python"), ("darwin", "bin/python"), ("win32", "Scripts/python.exe")],
)
def test_an_environment_is_made_and_filled_first(checkout: Path, platform: str, python: str) -> None:
    (venv, made), (install, mark) = make.list_setup(checkout, (), platform)
    assert venv == [sys.executable, "-m", "venv", ".venv"]
    assert made == checkout / ".venv" / python
    assert install[:4] == [str(checkout / ".venv" / python), "-m", "pip", "install"]
    assert install[-4:] == ["-c", "constraints.txt", "-e", ".[dev]"]
    assert mark == checkout / ".venv" / ".installed"


@pytest.mark.parametrize("platform", ["linux", "win32"])
def test_what_is_installed_is_installed_again_only_for_other_versions(checkout: Path, platform: str) -> None:
    fill(checkout, platform)
    assert make.list_setup(checkout, (), platform) == []
    assert [command[-1] for command, _ in make.list_setup(checkout, ("docs",), platform)] == [".[docs]"]
    os.utime(checkout / "constraints.txt", (4e9, 4e9))
    assert [command[-1] for command, _ in make.list_setup(checkout, (), platform)] == [".[dev]"]


def test_the_demo_and_the_tests_on_windows(checkout: Path) -> None:
    python = str(checkout / ".venv" / "Scripts" / "python.exe")
    assert make.list_commands("demo", checkout, platform="win32") == [
        [python, "-m", "evolution", "demo", "--out", "demo"]
    ]
    assert make.list_commands("test", checkout, ["-k", "gsrm"], "win32") == [
        [python, "-m", "pytest", "-m", "not slow", "-n", "2", "--dist", "loadfile", "-k", "gsrm"]
    ]
    assert make.list_commands("mutants", checkout, platform="win32")[0][0] == python


def test_mutants_are_polite_where_the_system_can(checkout: Path) -> None:
    assert make.list_commands("mutants", checkout, ["--again"], "linux")[0] == [
        *("nice", "-n", "15"), str(checkout / ".venv/bin/python"), "-m", "benchmarks.mutants", "--again",
    ]  # fmt: skip
    assert make.TARGETS["mutants"].variables == {"OMP_NUM_THREADS": "1"}


def test_the_first_failure_ends_a_target(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = []

    def run(command: list[str], **options: object) -> subprocess.CompletedProcess[bytes]:
        begun.append(" ".join(command[1:]))
        return subprocess.CompletedProcess(command, 3 if "pip" in command else 0)

    monkeypatch.setattr(make.subprocess, "run", run)
    assert make.run_target("demo", checkout) == 3
    assert len(begun) == 2
    assert not list(checkout.rglob(".installed"))  # so the next call installs again
    fill(checkout, sys.platform)
    assert make.run_target("check", checkout) == 0
    assert begun[2:] == ["-m ruff check .", "-m ruff format --check .", "-m pyright", "-m tools.licenses"]


def test_clean_removes_what_the_steps_make(checkout: Path) -> None:
    for name in (".venv", "demo", "mine"):
        (checkout / name).mkdir()
    assert make.run_target("clean", checkout) == 0
    assert sorted(path.name for path in checkout.iterdir()) == ["constraints.txt", "mine", "pyproject.toml"]


def test_the_makefile_has_the_same_targets() -> None:
    text = (ROOT / "Makefile").read_text()
    called = dict(re.findall(r"^([a-z-]+):\n\t\$\(STEP\) ([a-z-]+)", text, re.MULTILINE))
    assert called == {name: name for name in make.TARGETS}


@pytest.mark.parametrize(("words", "code", "said"), [(["--help"], 0, "demo"), (["fly"], 2, "fly")])
def test_the_script_needs_nothing_but_python(words: list[str], code: int, said: str, tmp_path: Path) -> None:
    command = [sys.executable, "-I", "-S", str(ROOT / "tools" / "make.py"), *words]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert said in done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_old_python_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(make, "MINIMUM", (4, 0))
    assert make.main(["setup"]) == 1
    assert "needs Python 3.11" in capsys.readouterr().err
