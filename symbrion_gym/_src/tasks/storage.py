"""Tasks as JSON: values by type and fields, functions by module and name.

What a file names is never called as it stands: it must be a dataclass or a plain function of the rooms named in
`KNOWN_ROOMS`, or of a module that the caller allows. Other modules are not even imported.
"""

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
        return {"type": find_name(type(value)), "fields": given}
    if isinstance(value, functools.partial):
        if value.args:
            raise TaskError(f"{value!r} has positional arguments; give them by name")
        keywords = {name: describe(each) for name, each in value.keywords.items()}
        return {"function": find_name(value.func), "keywords": keywords}
    if callable(value) and hasattr(value, "__qualname__"):
        return {"function": find_name(value)}
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


def find_name(value: Any, name: str = "") -> str:
    """Return "module:name", by which other processes find a function, a class or what a module names."""
    path = f"{value.__module__}:{name or value.__qualname__}"
    remedy = "so that it cannot be restored elsewhere; define it at the top of a module that can be imported"
    if "<" in path:
        raise TaskError(f"{path} is a lambda or defined inside a function, {remedy}")
    if path.startswith("__main__:"):
        raise TaskError(
            f"{path} is defined in the program that runs; move it into a module of its own and import it"
        )
    if find_value(path) is not value:
        raise TaskError(f"{path} has been replaced in its module, {remedy}, by a name of its own")
    return path


def find_value(name: str) -> Any:
    """Import what "module:name" names."""
    module, _, path = name.partition(":")
    parts = path.split(".")
    if not all(part.isidentifier() for part in (*module.split("."), *parts)):
        raise TaskError(f'is {name!r}; "module:name" is needed, such as "my_package.walking:Wave"')
    try:
        found: Any = importlib.import_module(module)
    except Exception as error:  # importing runs code of the user
        raise TaskError(
            f"{name!r}: module {module!r} cannot be imported ({type(error).__name__}: {error}); "
            "start in the folder that contains it, or add that folder to PYTHONPATH"
        ) from error
    for part in parts:
        if not hasattr(found, part):
            public = [each for each in dir(found) if not each.startswith("_")]
            raise TaskError(f"{name!r}: there is no {part!r} in it; there are: {', '.join(public)}")
        found = getattr(found, part)
    return found


def check_allowed(name: Any, allow: Collection[str]) -> None:
    """Refuse to import what a file names, unless its module, or a package that it lies in, is allowed."""
    module = str(name).partition(":")[0]
    if not any(module == each or module.startswith(f"{each}.") for each in allow):
        raise TaskError(
            f"{name!r} is code that a file names, and none is run unless it is allowed: "
            f"--allow-code {module}, in Python allow=({module!r},)"
        )


def _find_known(name: Any, allow: Collection[str]) -> Any:
    """Return a dataclass or function that a file names, imported only where its module is known or allowed."""
    check_allowed(name, (*KNOWN_ROOMS, *allow))
    module, _, path = str(name).partition(":")
    if any(part.startswith("_") for part in path.split(".")):
        raise TaskError(f"{name!r} is private; a file names public code only")
    found = find_value(str(name))
    is_kind = isinstance(found, FunctionType) or is_dataclass(found)
    if not is_kind or found.__module__ != module:
        raise TaskError(f"{name!r} is no dataclass and no plain function of that module")
    return found
