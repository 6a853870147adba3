"""Heavy libraries are imported only where they are needed: imports of the packages, help and errors do without them."""

import ast
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from reconstruction._src.base.lazy import export_lazily

ROOT = Path(__file__).parents[1]
PACKAGES = ("reconstruction", "symbrion_gym", "evolution")
OPTIONAL = {"matplotlib", "plotly", "imageio", "jinja2", "markupsafe", "PIL", "small_gicp", "pypcd4", "pxr"}
OPTIONAL |= {"collada", "laspy", "lazrs", "pye57", "mujoco_warp", "torch", "warp"}
LIBRARIES = {"coacd", "cma", "fast_simplification", "igl", "jax", "manifold3d"}
BASE = {"mujoco", "scipy", "trimesh"}
COMMAND_LINE = {"rich", "tyro"}
ARENA = "import gymnasium, symbrion_gym; gymnasium.make('symbrion_gym/SnakePit-v1', arena='gsrm', modules=3)"


def find_loaded(program: str, *, wanted_code: int = 0) -> set[str]:
    """Return the top names of all modules that a fresh process has loaded at the end of a program."""
    report = (
        "import atexit, sys; atexit.register(lambda: print('\\n' + ' '.join(sys.modules), file=sys.stderr))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", report + program],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == wanted_code, done.stderr[-2000:]
    return {name.split(".")[0] for name in done.stderr.splitlines()[-1].split()}


def run_command(*words: str) -> str:
    """Return a program that is the command `symbrion` with these words."""
    return f"import sys; from evolution.__main__ import main; sys.argv[1:] = {list(words)!r}; main()"


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_nothing_heavy(package: str) -> None:
    assert not find_loaded(f"import {package}") & (OPTIONAL | LIBRARIES | BASE | COMMAND_LINE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--help",), 0),
        (("evolve", "--help"), 0),
        (("evolve", "--arena", "nonsense"), 2),
        (("reconstruct", "nowhere.xyz"), 2),
        (("resume", "nowhere"), 2),
        (("survey", "truth", "--speed", "-1"), 2),
    ],
)
def test_help_and_refusals_load_nothing_heavy(words: tuple[str, ...], code: int) -> None:
    assert not find_loaded(run_command(*words), wanted_code=code) & (OPTIONAL | LIBRARIES | BASE)


@pytest.mark.slow
def test_environment_with_a_ready_made_arena_loads_no_network_and_no_plots() -> None:
    loaded = find_loaded(ARENA)
    assert not loaded & (
        (OPTIONAL | LIBRARIES | COMMAND_LINE) - {"manifold3d", "PIL"}
    )  # trimesh looks for these two
    assert loaded >= BASE


@pytest.mark.slow
def test_many_environments_on_the_processor_load_nothing_of_the_gpu() -> None:
    program = ARENA.replace("make(", "make_vec(").replace(
        "modules=3", "vectorization_mode='vector_entry_point'"
    )
    assert not find_loaded(program) & {"mujoco_warp", "torch", "warp"}


@pytest.mark.slow
def test_evaluation_on_the_processor_loads_nothing_of_the_gpu() -> None:
    program = (
        "import evolution as ev; ev.evaluate([[0.0]], arena='truth', modules=2, controller='posture', trials=1, "
        "duration=0.1)"
    )
    assert not find_loaded(program) & {"mujoco_warp", "torch", "warp", "ribs"}


@pytest.mark.parametrize("package", PACKAGES)
def test_lazy_names_are_those_that_are_listed(package: str) -> None:
    module = import_module(package)
    load, list_names = export_lazily(package)
    assert set(module.__all__) <= set(list_names())
    assert all(load(name) is getattr(module, name) for name in module.__all__ if name in _find_lazy(package))
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        load("nonsense")


@pytest.mark.parametrize("package", PACKAGES)
def test_no_lazy_name_is_a_module_of_its_package(package: str) -> None:
    folder = ROOT.joinpath(*package.split("."))
    modules = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert not modules & _find_lazy(package), "importing the module would hide the name: import it at once"


def _find_lazy(package: str) -> set[str]:
    """Return the names that a package imports for type checkers alone."""
    tree = ast.parse(ROOT.joinpath(*package.split("."), "__init__.py").read_text())
    blocks = [node for node in tree.body if isinstance(node, ast.If)]
    return {
        alias.name
        for block in blocks
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
