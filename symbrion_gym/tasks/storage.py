"""Tasks as JSON: values by type and fields, functions by module and name."""

from __future__ import annotations

import functools
import importlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from symbrion_gym.errors import TaskError

_PLAIN = (str, int, float, bool, type(None))


def describe(value: Any) -> Any:
    """Return JSON content from which `restore` makes an equal value.

    Args:
        value: a number, text, tuple, dataclass, class or function of a module, or `functools.partial` of one.

    Raises:
        TaskError: it cannot be restored, as a lambda or a function inside another.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, _PLAIN):
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


def restore(content: Any) -> Any:
    """Return the value of what `describe` returned.

    Raises:
        TaskError: a module or a name is not there, or does not take these fields.
    """
    if isinstance(content, list):
        return tuple(restore(each) for each in content)
    if not isinstance(content, dict):
        return content
    name = content.get("type", content.get("function"))
    found = _find(name)
    try:
        if "type" in content:
            return found(**{key: restore(each) for key, each in content.get("fields", {}).items()})
        if "keywords" in content:
            keywords = {key: restore(each) for key, each in content["keywords"].items()}
            return functools.partial(found, **keywords)
    except TypeError as error:
        raise TaskError(f"{name} does not take what was stored: {error}") from error
    return found


def _find_name(value: Any) -> str:
    """Return "module:name" of a class or function; it must be found there."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not module or not name or module == "__main__" or "<" in name:
        raise TaskError(
            f"{value!r} cannot be restored in another process; define it by `def` or `class` at the top of a module "
            "that can be imported"
        )
    path = f"{module}:{name}"
    if _find(path) is not value:
        raise TaskError(f"{path} is something else than {value!r}; give each function a name of its own")
    return path


def _find(name: Any) -> Any:
    module, _, path = name.partition(":") if isinstance(name, str) else ("", "", "")
    try:
        found: Any = importlib.import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError, ValueError) as error:
        raise TaskError(f"{name!r} is not there: {error}; put its module on the path") from error
    if not callable(found):
        raise TaskError(f"{name!r} is no class or function")
    return found
