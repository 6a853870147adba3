"""The rules of the house: imports point one way, public names exist, files stay readable."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WINGS = ("evolution", "symbrion_gym", "reconstruction")  # importer before imported
FILES = [path for wing in WINGS for path in sorted((ROOT / wing).rglob("*.py"))]
AROUND = ("benchmarks", "examples", "tests", "docs", "tools")  # what the wings never import
SOURCES = FILES + [path for folder in AROUND for path in sorted((ROOT / folder).rglob("*.py"))]
PACKAGES = [".".join(path.relative_to(ROOT).parent.parts) for path in FILES if path.name == "__init__.py"]


def _find_imports(source: str, package: tuple[str, ...]) -> set[str]:
    """Return the full names of all modules that a source imports, at any depth of its code.

    Args:
        source: Python code.
        package: the package it stands in, from which relative imports count.
    """
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else ()
            names.add(".".join((*start, *filter(None, [node.module]))))
    return names


def _find_file_imports(path: Path) -> set[str]:
    return _find_imports(path.read_text(), path.relative_to(ROOT).parent.parts)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_one_way(path: Path) -> None:
    own = WINGS.index(path.relative_to(ROOT).parts[0])
    backwards = {name for name in _find_file_imports(path) if name.split(".")[0] in WINGS[:own]}
    assert not backwards, f"{path.relative_to(ROOT)} imports against the road: {sorted(backwards)}"


@pytest.mark.parametrize("wing", ["reconstruction", "evolution"])
def test_only_the_middle_wing_knows_mujoco(wing: str) -> None:
    users = [
        str(path.relative_to(ROOT))
        for path in sorted((ROOT / wing).rglob("*.py"))
        if any(name.split(".")[0] == "mujoco" for name in _find_file_imports(path))
    ]
    assert not users


def test_import_reader_sees_relative_and_nested_imports() -> None:
    source = "def f():\n    from .b import c\n    from .. import d\n    import evolution.e\n"
    assert _find_imports(source, ("wing", "room")) == {"wing.room.b", "wing", "evolution.e"}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_exists_once(package: str) -> None:
    module = importlib.import_module(package)
    names = list(getattr(module, "__all__", []))
    assert len(names) == len(set(names))
    missing = [name for name in names if not hasattr(module, name)]
    assert not missing
    public = {name: getattr(module, name) for name in names}
    undocumented = [
        name
        for name, value in public.items()
        if (inspect.isclass(value) or inspect.isroutine(value)) and not value.__doc__
    ]
    assert not undocumented


@pytest.mark.parametrize("package", WINGS)
def test_each_wing_says_what_is_public(package: str) -> None:
    assert importlib.import_module(package).__all__


def test_wings_stand_without_what_lies_around_them() -> None:
    leaning = [
        str(path.relative_to(ROOT))
        for path in FILES
        if any(name.split(".")[0] in AROUND for name in _find_file_imports(path))
    ]
    assert not leaning


def test_files_stay_readable() -> None:
    long = {str(p.relative_to(ROOT)): n for p in SOURCES if (n := len(p.read_text().splitlines())) > 400}
    assert not long, f"split by concept: {long}"


def test_modules_are_named_after_their_subject() -> None:
    vague = [p for p in SOURCES if p.stem in ("utils", "util", "common", "helpers", "misc")]
    assert not vague, f"name the subject: {vague}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_each_module_says_what_it_is_about(path: Path) -> None:
    source = path.read_text()
    assert not source.strip() or ast.get_docstring(ast.parse(source)), "a module begins with a docstring"
