"""Options of the command line, made from the parts of the configuration of a run: names, defaults, meanings."""

import dataclasses
import json
import re
import sys
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_type_hints

import tyro

from evolution._src.backends.making import BACKENDS
from evolution._src.backends.parts import ORIGINS
from evolution._src.cli.command import UsageError
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from symbrion_gym._src.environment.config import STARTS

Place = tuple[float, float]
"""x and y [m]."""
CLI_TYPES: Mapping[str, Any] = {
    "modules": int | None,
    "organism": str | None,
    "task": str | None,
    "start": Literal[STARTS] | Place | None,
    "goal": Place | str | None,
    "environment": tuple[tuple[str, str], ...],
    "controller": str,
    "origin": Literal[ORIGINS],
    "backend": Literal[BACKENDS],
    "descriptors": tuple[str, ...],
    "folder": str,
}
"""Types of fields that are given as text here."""
ALIASES = {"population_size": ("--population",)}
"""Other names of flags."""
METAVARS = {"environment": "NAME VALUE ..."}
"""What stands for values whose types say too little."""
_ITEM = re.compile(r"^ {8}(\w+): (.*(?:\n {12}.*)*)", re.MULTILINE)


def read_meanings(kind: type) -> dict[str, str]:
    """Return what the docstring of a class says of its attributes."""
    _, _, section = (kind.__doc__ or "").partition("Attributes:\n")
    section = re.split(r"\n {4}\w", section)[0]
    return {name: " ".join(text.split()) for name, text in _ITEM.findall(section)}


def make_options(kind: type, **defaults: Any) -> type:
    """Return a dataclass of options with the fields of a part of the configuration.

    Args:
        kind: the part.
        defaults: other defaults of some fields.
    """
    meanings = read_meanings(kind)
    hints = get_type_hints(kind, vars(sys.modules[kind.__module__]))
    made = []
    for each in dataclasses.fields(kind):
        default = getattr(kind(), each.name) if each.name not in defaults else defaults[each.name]
        annotation = CLI_TYPES.get(each.name, hints[each.name])
        if dataclasses.is_dataclass(annotation):
            annotation = Annotated[annotation, tyro.conf.AvoidSubcommands]
        else:
            annotation = Annotated[annotation, _describe(each.name, meanings.get(each.name, ""))]
        made.append((each.name, annotation, dataclasses.field(default=default)))
    options = dataclasses.make_dataclass(f"{kind.__name__}Options", made, frozen=True)
    options.__doc__ = (kind.__doc__ or "").partition("\n")[0]
    return options


def _describe(name: str, meaning: str) -> Any:
    text = meaning.replace("`", "")
    return tyro.conf.arg(
        help=text[:1].upper() + text[1:], aliases=ALIASES.get(name), metavar=METAVARS.get(name)
    )


def read_environment(pairs: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    """Return options of the environment, their values read as JSON where they are such."""
    return {name: _read_value(text) for name, text in pairs}


def _read_value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def make_config(fields: Mapping[str, Any]) -> EvolutionConfig:
    """Return the configuration of options.

    Raises:
        UsageError: a value is refused; the message begins with the flag and what was given.
    """
    try:
        return EvolutionConfig(**fields)
    except RunError as error:
        raise UsageError(name_flag(str(error), fields)) from error


def name_flag(message: str, fields: Mapping[str, Any]) -> str:
    """Return the message of a configuration with the flag and its value first."""
    name = re.match(r"\w+", message)
    if name is None or not isinstance(fields.get(name[0]), str | int | float | tuple):
        return message
    given = fields[name[0]]
    text = " ".join(map(str, given)) if isinstance(given, tuple) else str(given)
    return f"--{name[0].replace('_', '-')} {text}: {message}"
