"""The floors of the house: among the children of each folder, imports form no circle and none runs back up."""

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
        package: the package it stands in, from which relative imports count.
        modules: all there are; what is imported out of one of them counts as that module.
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


def find_arrows(root: Path, packages: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield importer and imported, all files but the faces of packages (`__init__`)."""
    paths = [
        path for package in packages for path in (root / package).rglob("*.py") if path.stem != "__init__"
    ]
    names = {path: path.relative_to(root).with_suffix("").parts for path in paths}
    modules = {".".join(parts) for parts in names.values()}
    for path, parts in names.items():
        for imported in find_imports(path.read_text(), parts[:-1], modules):
            yield ".".join(parts), imported


def find_circle(arrows: list[tuple[str, str]], folder: str) -> list[str]:
    """Return the children of a folder, files and folders, that import each other in a circle."""
    depth = folder.count(".") + 1 if folder else 0
    graph: dict[str, set[str]] = {}
    for importer, imported in arrows:
        if all(name.startswith(f"{folder}." if folder else "") for name in (importer, imported)):
            above, below = (".".join(name.split(".")[: depth + 1]) for name in (importer, imported))
            if above != below:
                graph.setdefault(above, set()).add(below)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


ARROWS = list(find_arrows(ROOT, PACKAGES))


@pytest.mark.parametrize("folder", ["", *(".".join(path.relative_to(ROOT).parts) for path in FOLDERS)])
def test_children_of_a_folder_stand_on_floors(folder: str) -> None:
    circle = find_circle(ARROWS, folder)
    among = [arrow for arrow in ARROWS if _is_between(arrow, circle)]
    assert not circle, f"{' -> '.join(reversed(circle))}: {among}"


def test_circles_are_seen_on_every_level(tmp_path: Path) -> None:
    sources = {
        "house/ground/a.py": "",
        "house/ground/b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import house.upper.c\n",
        "house/upper/c.py": "def f():\n    from house.ground import a\n",
        "house/upper/d.py": "from .c import f\n",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source)
    arrows = list(find_arrows(tmp_path, ("house",)))
    assert sorted(arrows) == [
        ("house.ground.b", "house.upper.c"),
        ("house.upper.c", "house.ground.a"),
        ("house.upper.d", "house.upper.c"),
    ]
    assert set(find_circle(arrows, "house")) == {"house.ground", "house.upper"}
    assert not find_circle(arrows, "house.upper")
    assert not find_circle(arrows, "")


def _is_between(arrow: tuple[str, str], names: list[str]) -> bool:
    ends = [next((name for name in names if f"{end}.".startswith(f"{name}.")), None) for end in arrow]
    return None not in ends and ends[0] != ends[1]
