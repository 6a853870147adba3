"""An installed wheel works from another folder: packages, assets and the command are all in it."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project's wheel, built from this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder)]
    subprocess.run([*pip, "wheel", *options, str(ROOT)], check=True, cwd=folder)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the wheel is installed into, away from the checkout."""
    folder = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--quiet", "--no-deps", "--target", str(folder), str(wheel)], check=True)
    return folder


def run_python(site: Path, folder: Path, *words: str) -> str:
    """Run Python in another folder, with the installed wheel before everything else; return what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_wheel_holds_packages_and_assets_alone(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    roots = {name.split("/")[0] for name in names}
    assert {root for root in roots if ".dist-info" not in root} == {
        "reconstruction",
        "symbrion_gym",
        "evolution",
    }
    for arena in ("truth", "simple", "gsrm", "gg"):
        assert f"symbrion_gym/assets/arenas/{arena}/arena.json" in names
    assert "evolution/report/page.html.j2" in names


def test_ready_made_arenas_are_small() -> None:
    size = sum(path.stat().st_size for path in (ROOT / "assets").rglob("*") if path.is_file())
    assert size < 5_000_000


def test_gym_make_works_from_another_folder(site: Path, tmp_path: Path) -> None:
    program = """
import gymnasium as gym, symbrion_gym
assert symbrion_gym.__file__.startswith({site!r}), symbrion_gym.__file__
for arena in ("truth", "simple", "gsrm", "gg"):
    env = gym.make("symbrion_gym/SnakePit-v0", arena=arena, modules=4)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    print(arena)
"""
    printed = run_python(site, tmp_path, "-c", program.format(site=str(site)))
    assert printed.split() == ["truth", "simple", "gsrm", "gg"]


def test_command_works_from_another_folder(site: Path, tmp_path: Path) -> None:
    assert "survey" in run_python(site, tmp_path, "-m", "evolution.cli", "--help")
    words = ["--generations", "2", "--population", "4", "--modules", "3", "--trials", "1", "--folder", "run"]
    run_python(site, tmp_path, "-m", "evolution.cli", "evolve", *words)
    assert (tmp_path / "run" / "history.csv").exists()
