"""Tasks as JSON: values by type and fields, functions by module and name.

What a file names is never called as it stands: it must be a dataclass or a plain function of the rooms named in
`KNOWN_ROOMS`, or of a module that the caller allows. Other modules are not even imported.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Collection
from dataclasses import fields, is_dataclass
from types import FunctionType
from typing import Any

import numpy as np

from symbrion_gym._src.errors import TaskError

KNOWN_ROOMS = ("symbrion_gym._src.tasks",)
"""Where the tasks, goals, terms and recorders of this project are defined."""


def describe(value: Any) -> Any:
    """Return JSON content from which `restore` makes an equal value."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, str | int | float | bool):
        return value
    if isinstance(value, tuple | list):
        return [describe(each) for each in value]
    if is_dataclass(value) and not isinstance(value, type):
        given = {each.name: describe(getattr(value, each.name)) for each in fields(value) if each.init}
        return {"type": _find_name(type(value)), "fields": given}
    if isinstance(value, functools.partial):
        if value.args:
            raise TaskError(f"{value!r} has positional arguments; give them by name")
        keywords = {name: describe(each) for name, each in value.keywords.items()}
        return {"function": _find_name(value.func), "keywords": keywords}
    if callable(value):
        return {"function": _find_name(value)}
    raise TaskError(f"{value!r} cannot be stored; use numbers, texts, tuples, dataclasses and functions")


def restore(content: Any, allow: Collection[str] = ()) -> Any:
    """Return the value of what `describe` returned."""
    if isinstance(content, list):
        return tuple(restore(each, allow) for each in content)
    if not isinstance(content, dict):
        return content
    is_value = "type" in content
    name = content.get("type", content.get("function"))
    found = _find_known(name, allow)
    given = content.get("fields" if is_value else "keywords", {})
    if not isinstance(given, dict):
        raise TaskError(f"{name}: its fields are {given!r}; an object is needed")
    if is_value and not isinstance(found, type):
        raise TaskError(f"{name!r} is no dataclass, so that nothing is made of it")
    if not is_value and "keywords" not in content:
        return found
    try:
        keywords = {key: restore(each, allow) for key, each in given.items()}
        return found(**keywords) if is_value else functools.partial(found, **keywords)
    except TypeError as error:
        raise TaskError(f"{name} does not take what was stored: {error}") from error


def _find_name(value: Any) -> str:
    """Return "module:name" of a class or function; it must be found there."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not module or not name or module == "__main__" or "<" in name:
        raise TaskError(
            f"{value!r} cannot be restored in another process; define it by `def` or `class` at the top of a module "
            "that can be imported"
        )
    if _find(module, name) is not value:
        raise TaskError(
            f"{module}:{name} is something else than {value!r}; give each function a name of its own"
        )
    return f"{module}:{name}"


def is_allowed(module: str, allow: Collection[str]) -> bool:
    """Return whether a module is one of those named, or lies in a package that is."""
    return any(module == each or module.startswith(f"{each}.") for each in allow)


def _find_known(name: Any, allow: Collection[str]) -> Any:
    """Return a dataclass or function that a file names, imported only where its module is known or allowed."""
    module, _, path = name.partition(":") if isinstance(name, str) else ("", "", "")
    if not is_allowed(module, (*KNOWN_ROOMS, *allow)):
        raise TaskError(
            f"{name!r} is not code of this project, and a file runs none unless it is allowed: "
            f"--allow-code {module}, in Python allow=({module!r},)"
        )
    if any(part.startswith("_") for part in path.split(".")):
        raise TaskError(f"{name!r} is private; a file names public code only")
    found = _find(module, path)
    is_kind = isinstance(found, FunctionType) or is_dataclass(found)
    if not is_kind or found.__module__ != module:
        raise TaskError(f"{name!r} is no dataclass and no plain function of that module")
    return found


def _find(module: str, path: str) -> Any:
    try:
        found: Any = importlib.import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError, ValueError) as error:
        raise TaskError(f"{module}:{path} is not there: {error}; put its module on the path") from error
    return found
