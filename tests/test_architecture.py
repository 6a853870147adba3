"""The structure of the code: imports point one way, public names exist, files stay short."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOP_PACKAGES = ("evolution", "symbrion_gym", "reconstruction")  # importer before imported
FILES = [path for package in TOP_PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
OTHER_FOLDERS = ("benchmarks", "examples", "tests", "docs", "tools")  # the packages never import them
SOURCES = FILES + [path for folder in OTHER_FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
PACKAGES = [".".join(path.relative_to(ROOT).parent.parts) for path in FILES if path.name == "__init__.py"]


def _find_imports(source: str, package: tuple[str, ...]) -> set[str]:
    """Return the full names of all modules that a source imports, at any depth of its code.

    Args:
        source: Python code.
        package: the package that contains it, to which relative imports refer.
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
    own = TOP_PACKAGES.index(path.relative_to(ROOT).parts[0])
    backwards = {name for name in _find_file_imports(path) if name.split(".")[0] in TOP_PACKAGES[:own]}
    assert not backwards, f"{path.relative_to(ROOT)} imports a later package: {sorted(backwards)}"


@pytest.mark.parametrize("package", ["reconstruction", "evolution"])
def test_only_symbrion_gym_imports_mujoco(package: str) -> None:
    users = [
        str(path.relative_to(ROOT))
        for path in sorted((ROOT / package).rglob("*.py"))
        if any(name.split(".")[0] == "mujoco" for name in _find_file_imports(path))
    ]
    assert not users


def test_import_reader_sees_relative_and_nested_imports() -> None:
    source = "def f():\n    from .b import c\n    from .. import d\n    import evolution.e\n"
    assert _find_imports(source, ("package", "folder")) == {"package.folder.b", "package", "evolution.e"}


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


@pytest.mark.parametrize("package", TOP_PACKAGES)
def test_each_package_lists_its_public_names(package: str) -> None:
    assert importlib.import_module(package).__all__


def test_packages_import_nothing_from_other_folders() -> None:
    dependent = [
        str(path.relative_to(ROOT))
        for path in FILES
        if any(name.split(".")[0] in OTHER_FOLDERS for name in _find_file_imports(path))
    ]
    assert not dependent


def test_files_are_short() -> None:
    long = {str(p.relative_to(ROOT)): n for p in SOURCES if (n := len(p.read_text().splitlines())) > 400}
    assert not long, f"split by concept: {long}"


def test_modules_are_named_after_their_subject() -> None:
    vague = [p for p in SOURCES if p.stem in ("utils", "util", "common", "helpers", "misc")]
    assert not vague, f"name the subject: {vague}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_each_module_has_a_docstring(path: Path) -> None:
    source = path.read_text()
    assert not source.strip() or ast.get_docstring(ast.parse(source)), "a module begins with a docstring"
