"""Imports form no cycle, neither between modules nor between the folders that contain them."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("evolution", "symbrion_gym", "reconstruction")
FOLDERS = sorted(path.parent for package in PACKAGES for path in (ROOT / package).rglob("__init__.py"))


def find_imports(source: str, package: tuple[str, ...], modules: set[str]) -> set[str]:
    """Return the modules that a source imports, at any depth of its code and for type checkers, too.

    Args:
        source: Python code.
        package: the package of the source; relative imports start there.
        modules: names of all modules; a name imported from one of them counts as that module.
    """
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else ()
            origin = ".".join((*start, *filter(None, [node.module])))
            found |= {
                name if (name := f"{origin}.{alias.name}") in modules else origin for alias in node.names
            }
    return found & modules


def list_imports(root: Path, packages: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield importer and imported of every import between modules, without `__init__`."""
    paths = [
        path for package in packages for path in (root / package).rglob("*.py") if path.stem != "__init__"
    ]
    names = {path: path.relative_to(root).with_suffix("").parts for path in paths}
    modules = {".".join(parts) for parts in names.values()}
    for path, parts in names.items():
        for imported in find_imports(path.read_text(), parts[:-1], modules):
            yield ".".join(parts), imported


def find_cycle(imports: list[tuple[str, str]], folder: str) -> list[str]:
    """Return the modules and subfolders of a folder that import each other in a cycle."""
    depth = folder.count(".") + 1 if folder else 0
    graph: dict[str, set[str]] = {}
    for importer, imported in imports:
        if all(name.startswith(f"{folder}." if folder else "") for name in (importer, imported)):
            importing, other = (".".join(name.split(".")[: depth + 1]) for name in (importer, imported))
            if importing != other:
                graph.setdefault(importing, set()).add(other)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


IMPORTS = list(list_imports(ROOT, PACKAGES))


@pytest.mark.parametrize("folder", ["", *(".".join(path.relative_to(ROOT).parts) for path in FOLDERS)])
def test_modules_and_subfolders_of_a_folder_import_without_a_cycle(folder: str) -> None:
    cycle = find_cycle(IMPORTS, folder)
    among = [each for each in IMPORTS if _is_between(each, cycle)]
    assert not cycle, f"{' -> '.join(reversed(cycle))}: {among}"


def test_cycles_are_found_on_every_level(tmp_path: Path) -> None:
    sources = {
        "package/lower/a.py": "",
        "package/lower/b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import package.upper.c\n",
        "package/upper/c.py": "def f():\n    from package.lower import a\n",
        "package/upper/d.py": "from .c import f\n",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source)
    imports = list(list_imports(tmp_path, ("package",)))
    assert sorted(imports) == [
        ("package.lower.b", "package.upper.c"),
        ("package.upper.c", "package.lower.a"),
        ("package.upper.d", "package.upper.c"),
    ]
    assert set(find_cycle(imports, "package")) == {"package.lower", "package.upper"}
    assert not find_cycle(imports, "package.upper")
    assert not find_cycle(imports, "")


def _is_between(pair: tuple[str, str], names: list[str]) -> bool:
    ends = [next((name for name in names if f"{end}.".startswith(f"{name}.")), None) for end in pair]
    return None not in ends and ends[0] != ends[1]
