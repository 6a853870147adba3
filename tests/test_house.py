"""The house: imports run one way and in no circle, public names are few, files are written by one function."""

import ast
import importlib
import inspect
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("evolution", "symbrion_gym", "reconstruction")  # importer before imported
SOURCES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8")
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}
"""Name of each module -> its text."""
MOST_NAMES = 45
WRITERS = {
    "write_text",
    "write_bytes",
    "savez",
    "savez_compressed",
    "savefig",
    "tofile",
    "dump",
    "rmtree",
    "unlink",
}
MAY_WRITE = {
    "evolution._src.experiments.train": "removes models that nothing has evolved in",
    "reconstruction._src.base.atomic_write": "the writer",
    "symbrion_gym._src.arenas.saving": "removes what the manifest of an arena names",
    "symbrion_gym._src.arenas.export.export": "removes what the manifest of an export names",
    "symbrion_gym._src.contact.coacd": "into a temporary folder",
    "symbrion_gym._src.contact.coacd_worker": "into the same",
    "evolution._src.search.run": "the four files of a run",
    "reconstruction._src.tiles.folder": "removes the tiles of its own manifest",
}


@cache
def parse(module: str) -> ast.Module:
    return ast.parse(SOURCES[module])


def find_imports(module: str) -> set[str]:
    """Return the modules of this project that a module imports, at any depth and for type checkers, too."""
    found: set[str] = set()
    for node in ast.walk(parse(module)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{module}: imports are absolute"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in SOURCES else str(node.module) for name in names}
    return {name for name in found if name.partition(".")[0] in PACKAGES} - {module}


@cache
def find_all_imports() -> dict[str, set[str]]:
    return {module: find_imports(module) for module in SOURCES}


def find_circle(folder: str) -> list[str]:
    """Return modules and folders of a folder that import each other in a circle."""
    depth = folder.count(".") + 2
    graph: dict[str, set[str]] = {}
    for importer, imported in ((a, b) for a, names in find_all_imports().items() for b in names):
        ends = [".".join(name.split(".")[:depth]) for name in (importer, imported)]
        if all(name.startswith(f"{folder}.") for name in ends) and ends[0] != ends[1]:
            graph.setdefault(ends[0], set()).add(ends[1])
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_imports_run_from_evolution_to_reconstruction():
    order = {package: place for place, package in enumerate(PACKAGES)}
    for module, names in find_all_imports().items():
        own = order[module.partition(".")[0]]
        assert all(order[name.partition(".")[0]] >= own for name in names), (
            f"{module} imports a later package"
        )


def test_the_base_imports_nothing_of_the_project_but_itself():
    base = "reconstruction._src.base"
    for module in (name for name in SOURCES if name.startswith(f"{base}.")):
        assert all(name.startswith(base) for name in find_imports(module)), module


def test_only_symbrion_gym_calls_mujoco():
    users = [name for name, text in SOURCES.items() if "import mujoco" in text]
    assert all(name.startswith("symbrion_gym.") for name in users)


def test_no_folder_has_a_circle_of_imports():
    folders = {
        ".".join(name.split(".")[:depth]) for name in SOURCES for depth in range(2, name.count(".") + 1)
    }
    circles = {folder: circle for folder in folders if (circle := find_circle(folder))}
    assert not circles


@pytest.mark.parametrize("package", PACKAGES)
def test_the_house_has_few_rooms_and_floors(package):
    names = [name.split(".")[2:] for name in SOURCES if name.startswith(f"{package}._src.")]
    assert len({parts[0] for parts in names if len(parts) > 1}) <= 8
    assert max(map(len, names)) <= 4


def test_a_circle_is_found(monkeypatch):
    names = ["p._src.low.a", "p._src.high.b", "p._src.high.c", "p._src.low.d"]
    monkeypatch.setitem(globals(), "find_all_imports", lambda: {a: {b} for a, b in pairwise(names)})
    assert set(find_circle("p._src")) == {"p._src.low", "p._src.high"}
    assert not find_circle("p._src.high")


def test_public_names_are_few_and_described():
    for package in PACKAGES:
        module = importlib.import_module(package)
        public = {name: getattr(module, name) for name in module.__all__}
        assert len(public) == len(module.__all__) <= MOST_NAMES, package
        things = {
            name: value
            for name, value in public.items()
            if inspect.isclass(value) or inspect.isroutine(value)
        }
        assert all(value.__doc__ for value in things.values()), package


def test_each_module_begins_with_what_it_is():
    assert not [name for name, text in SOURCES.items() if text.strip() and not ast.get_docstring(parse(name))]


def test_files_are_written_by_one_function():
    """Through `write_atomically`, so that none is ever half-written; each exception is named with its reason."""
    for module, text in SOURCES.items():
        calls = {
            node.func.attr
            for node in ast.walk(parse(module))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        }
        writes = calls & WRITERS
        assert not writes or "write_atomically" in text or "BytesIO" in text or module in MAY_WRITE, (
            module,
            writes,
        )


def test_modules_are_named_after_their_subject():
    vague = {"utils", "util", "common", "helpers", "misc"}
    assert not [name for name in SOURCES if name.rpartition(".")[2] in vague]
