"""The core works without the extras; what needs one names it in one line, before any work."""

import os
import re
import subprocess
import sys
import tomllib
import venv
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import reconstruction._src.base.extras
from evolution import __main__ as start
from evolution._src.cli.main import run
from reconstruction._src.base.extras import EXTRAS, MissingExtraError, require_extras

ROOT = Path(__file__).parents[1]
MODULES = [module for modules in EXTRAS.values() for module in modules]
CORE_PIPELINE = f"""
import gymnasium as gym, numpy as np, sys
from importlib.util import find_spec
assert not [name for name in {MODULES} if name in sys.modules or find_spec(name)], "more than the core is installed"
import evolution as ev, reconstruction as rc, symbrion_gym as sg
env = gym.make("symbrion_gym/SnakePit-v1", arena="gsrm", modules=3)
env.reset(seed=0)
env.step(env.action_space.sample())
x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-0.5, 0.5, 20)))
surface = rc.reconstruct(np.c_[x, y, 0.1 * np.abs(x)], units=60)
surface.quality()
arena = sg.make_arena(surface.mesh, cache=False)
assert arena.pieces and arena.spec().compile().ngeom
run = ev.evolve(
    ev.EvolutionConfig(arena="truth", modules=3, generations=1, population_size=4, trials=1, workers=1, folder="run")
)
assert len(run.history) == 1
print("the pipeline needs only the core")
"""
HIDE = f"""
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {MODULES}:
            raise ModuleNotFoundError(name)
import importlib.util
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name in {MODULES} else found(name, package)
sys.meta_path.insert(0, Hidden())
"""


@pytest.fixture
def without_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every module of every extra but `cli` look absent."""
    absent = set(MODULES) - set(EXTRAS["cli"])
    found = reconstruction._src.base.extras.find_spec
    monkeypatch.setattr(
        reconstruction._src.base.extras, "find_spec", lambda name: None if name in absent else found(name)
    )


def _normalize(requirement: str) -> str:
    match = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert match
    return re.sub(r"[-_.]+", "-", match[0]).lower()


find_distributions = cache(packages_distributions)


@pytest.mark.parametrize("extra", EXTRAS)
def test_extras_bring_what_the_code_asks_for(extra: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    known = {"warp": ["warp-lang"], **find_distributions()}  # where the extra gpu is not installed
    brought = {_normalize(line) for line in project["optional-dependencies"][extra]}
    assert {_normalize(known.get(module, [module])[0]) for module in EXTRAS[extra]} == brought
    assert not brought & {_normalize(line) for line in project["dependencies"]}
    is_in_all = extra in project["optional-dependencies"]["all"][0]
    assert is_in_all == (extra not in ("rl", "ribs", "gpu")), (
        "these bring PyTorch, Numba and CUDA, larger than all the rest"
    )


def test_nothing_is_said_where_all_is_there() -> None:
    require_extras("all", *(extra for extra in EXTRAS if extra not in ("rl", "ribs", "gpu")))


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["demo", "--out", "{folder}/demo"], "the extras 'scan' and 'report'"),
        (["paper", "--out", "{folder}/paper"], "the extras 'scan' and 'report'"),
        (["survey", "truth", "--out", "{folder}/log.npz"], "the extra 'scan'"),
        (["replay", "{folder}", "--video", "{folder}/film.mp4"], "the extra 'report'"),
        (["export", "truth", "--to", "usd", "--out", "{folder}/usd"], "the extra 'usd'"),
    ],
)
@pytest.mark.usefixtures("without_extras")
def test_a_command_says_which_extra_it_lacks(
    words: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "config.json").write_text("{}")
    assert run([word.format(folder=tmp_path) for word in words]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert wanted in line
    assert re.search(r"pip install 'symbrion-gym\[(scan|report|usd|,)+\]'$", line)
    assert [path.name for path in tmp_path.iterdir()] == ["config.json"], "nothing was begun"


def test_the_command_line_says_that_it_lacks_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reconstruction._src.base.extras, "find_spec", lambda name: None)
    with pytest.raises(SystemExit, match=r"^symbrion: .*'cli'.*pip install 'symbrion-gym\[cli\]'$") as end:
        start.main()
    assert "\n" not in str(end.value.code)


@pytest.mark.usefixtures("without_extras")
def test_a_library_call_says_which_extra_it_lacks() -> None:
    import symbrion_gym as sg

    with pytest.raises(MissingExtraError, match="a survey needs the extra 'scan'"):
        sg.survey("truth")


def run_pipeline(python: Path | str, program: str, folder: Path, **variables: str) -> None:
    """Run a program in a folder and fail with its errors where it fails."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "SYMBRION_CACHE": str(folder / "cache"), **variables}
    done = subprocess.run(
        [str(python), "-W", "error::UserWarning:cma", "-c", program],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert "only the core" in done.stdout


@pytest.mark.slow
def test_the_pipeline_runs_with_the_extras_hidden(tmp_path: Path) -> None:
    run_pipeline(sys.executable, HIDE + CORE_PIPELINE, tmp_path, PYTHONPATH=str(ROOT))


@pytest.mark.long
def test_the_pipeline_runs_after_pip_install_only(tmp_path: Path) -> None:
    """A fresh environment with `pip install .` and nothing else; needs a package index."""
    venv.create(tmp_path / "venv", with_pip=True)
    python = tmp_path / "venv" / "bin" / "python"
    words = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run(
        [str(python), *words, "-c", str(ROOT / "constraints.txt"), str(ROOT)],
        capture_output=True,
        text=True,
        check=False,
    )
    if re.search(r"connection|resolution|timed out", done.stderr, re.IGNORECASE):
        pytest.skip("no package index can be reached")
    assert done.returncode == 0, done.stderr[-3000:]
    run_pipeline(python, CORE_PIPELINE, tmp_path, PYTHONPATH="")
