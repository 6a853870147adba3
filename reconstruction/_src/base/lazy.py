"""Public names that load their module at first use, so that importing a package costs next to nothing."""

import ast
import functools
import importlib
import sys
from collections.abc import Callable
from importlib.abc import InspectLoader
from typing import Any


def export_lazily(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and `__dir__` (PEP 562) of a package that lists its names under `TYPE_CHECKING`.

    The one list of names and their modules is the one that type checkers read: the `from ... import ...` lines in
    the block `if TYPE_CHECKING:` of the package's `__init__.py`. Each name is imported when it is first asked for,
    then stands in the package as if it had been imported there.

    A name that is also a module of the package cannot be among them: importing that module would hide it.
    """
    module = sys.modules[package]

    @functools.cache
    def find_origins() -> dict[str, str]:
        loader = module.__spec__.loader if module.__spec__ else None
        source = loader.get_source(package) if isinstance(loader, InspectLoader) else None
        return _read_origins(source or "")

    def load(name: str) -> Any:
        origin = None if name.startswith("__") else find_origins().get(name)
        if origin is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(origin), name)
        setattr(module, name, value)
        return value

    def list_names() -> list[str]:
        return sorted({*vars(module), *find_origins()})

    return load, list_names


def _read_origins(source: str) -> dict[str, str]:
    """Return name -> module of what a source imports under `if TYPE_CHECKING:`."""
    blocks = [
        node.body
        for node in ast.parse(source).body
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    ]
    return {
        alias.name: node.module
        for block in blocks
        for node in block
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
