"""JSON from outside, read strictly: numbers are finite, nesting is bounded, every field has its type.

Two steps: `read_json` reads a file as plain content, `as_type` turns content into a dataclass or another
type. Messages name the field; the caller adds the file and the remedy.
"""

import dataclasses
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import msgspec

from reconstruction.printable import make_printable

LARGEST_FILE = 64 * 2**20
"""Bytes; our own descriptions have some kilobytes."""
DEEPEST = 50
"""Levels of nesting; our own descriptions have six."""

T = TypeVar("T")


class JsonError(ValueError):
    """Content is no JSON, or not of the type that was asked for; the message is one printable line."""

    def __init__(self, message: str) -> None:
        super().__init__(make_printable(message))


def read_json(path: str | os.PathLike[str]) -> Any:
    """Read a JSON file as plain content.

    Raises:
        JsonError: missing, too large, damaged, nested too deeply, or with a number that is not finite.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise JsonError("no such file")
        if path.stat().st_size > LARGEST_FILE:
            raise JsonError(f"larger than {LARGEST_FILE // 2**20} MB")
        content = json.loads(path.read_bytes(), parse_constant=_refuse_constant, parse_float=_parse_finite)
        _refuse_deep(content)
    except (OSError, ValueError) as error:
        raise JsonError(f"cannot be read as JSON ({error})") from error
    except RecursionError:
        raise JsonError("cannot be read as JSON (nested too deeply)") from None
    return content


def as_type(content: Any, kind: type[T], where: str = "", *, others_allowed: bool = False) -> T:
    """Return plain content as a value of a type: dataclasses of objects, tuples of lists, floats of integers.

    Args:
        content: as `read_json` returned it.
        kind: the type; a dataclass checks the range of its fields itself.
        where: name of the content, for messages.
        others_allowed: whether entries that a dataclass does not have are left alone.

    Raises:
        JsonError: a field is missing, unknown, of another type, or refused by a dataclass with a ValueError.
    """
    try:
        value = msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        raise JsonError(_describe(error, where)) from error
    if not others_allowed:
        _refuse_unknown(content, value, where)
    return value


def _describe(error: msgspec.ValidationError, where: str) -> str:
    """Put the field first: "config.modules: expected `int`, got `str`"."""
    what, _, path = str(error).rpartition(" - at `$")
    field = f"{where}{path[:-1]}".lstrip(".") if what else where
    what = (what or path).replace("Object missing required field", "lacks the field")
    return f"{field}: {what}" if field else what


def _refuse_unknown(content: Any, value: Any, where: str) -> None:
    """Refuse what msgspec overlooks: fields that a dataclass does not have."""
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        unknown = sorted(set(content) - set(names))
        if unknown:
            raise JsonError(f"{where or 'it'} has unknown entries {unknown}; there are {', '.join(names)}")
        for name in content:
            _refuse_unknown(content[name], getattr(value, name), f"{where}.{name}".lstrip("."))
    elif isinstance(value, tuple) and isinstance(content, Sequence):
        for index, (inner, each) in enumerate(zip(content, value, strict=False)):
            _refuse_unknown(inner, each, f"{where}[{index}]")


def _refuse_deep(content: Any) -> None:
    level = [content]
    for _ in range(DEEPEST):
        level = [
            inner
            for each in level
            if isinstance(each, dict | list)
            for inner in (each.values() if isinstance(each, dict) else each)
        ]
        if not level:
            return
    raise JsonError("nested too deeply")


def _refuse_constant(name: str) -> NoReturn:
    raise JsonError(f"{name} is no number")


def _parse_finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise JsonError(f"{text} is too large")
    return number
