"""An installed wheel works from another folder: it contains packages, assets and the command."""

import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import packages_distributions
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
    for package in ("reconstruction", "symbrion_gym", "evolution"):
        assert f"{package}/py.typed" in names
    assert "evolution/_src/report/page.html.j2" in names
    assert "evolution/_src/experiments/paper.html.j2" in names
    assert "symbrion_gym/_src/arenas/export/templates/load_mjlab.py.txt" in names


def _normalize(requirement: str) -> str:
    """Return the name of a distribution as the index compares it."""
    match = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert match, requirement
    return re.sub(r"[-_.]+", "-", match[0]).lower()


def _find_foreign_imports() -> Iterator[tuple[str, str]]:
    """Yield (file, package) of what the packages import from elsewhere."""
    own = ("reconstruction", "symbrion_gym", "evolution")
    for path in (path for package in own for path in sorted((ROOT / package).rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [node.module]
            for root in {name.split(".")[0] for name in names} - set(own) - set(sys.stdlib_module_names):
                yield str(path.relative_to(ROOT)), root


@pytest.mark.slow
def test_what_is_imported_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [one for group in project["optional-dependencies"].values() for one in group]
    declared = {_normalize(one) for one in (*project["dependencies"], *extras)}
    known = {"warp": ["warp-lang"], **packages_distributions()}  # where the extra gpu is not installed
    missing = [
        (file, root)
        for file, root in _find_foreign_imports()
        if not {_normalize(one) for one in known.get(root, [root])} & declared
    ]
    assert not missing, "name it in pyproject.toml"


def test_constraints_pin_what_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "constraints.txt").read_text().split()
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[^/@ ]+", line) for line in lines), (
        "versions alone, no addresses"
    )
    pinned = {_normalize(line) for line in lines}
    groups = ("cli", "scan", "report", "embree", "docs", "test", "dev")
    wanted = [
        *project["dependencies"],
        *(one for name in groups for one in project["optional-dependencies"][name]),
    ]
    assert {_normalize(one) for one in wanted} - {"symbrion-gym"} <= pinned


def test_ready_made_arenas_are_small() -> None:
    size = sum(path.stat().st_size for path in (ROOT / "assets").rglob("*") if path.is_file())
    assert size < 5_000_000


@pytest.mark.slow
def test_gym_make_works_from_another_folder(site: Path, tmp_path: Path) -> None:
    program = """
import gymnasium as gym, symbrion_gym
assert symbrion_gym.__file__.startswith({site!r}), symbrion_gym.__file__
for arena in ("truth", "simple", "gsrm", "gg"):
    env = gym.make("symbrion_gym/SnakePit-v1", arena=arena, modules=4)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    print(arena)
"""
    printed = run_python(site, tmp_path, "-c", program.format(site=str(site)))
    assert printed.split() == ["truth", "simple", "gsrm", "gg"]


@pytest.mark.slow
def test_command_works_from_another_folder(site: Path, tmp_path: Path) -> None:
    assert "survey" in run_python(site, tmp_path, "-m", "evolution", "--help")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"symbrion": "evolution.__main__:main"}
    words = ["--generations", "2", "--population-size", "4", "--modules", "3", "--trials", "1"]
    run_python(site, tmp_path, "-m", "evolution._src.cli.main", "evolve", *words, "--folder", "run")
    assert (tmp_path / "run" / "history.csv").exists()
