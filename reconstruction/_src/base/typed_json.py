"""JSON, written and read strictly: finite numbers, bounded nesting, typed fields.

Two steps: `read_json` reads a file as plain content, `as_type` turns content into a dataclass or another
type. Messages name the field; the caller adds the file and the remedy.
"""

import dataclasses
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from reconstruction._src.base.atomic_write import write_file
from reconstruction._src.base.errors import ReconstructionPackageError
from reconstruction._src.base.printable import make_printable

MAX_FILE_BYTES = 64 * 2**20  # Largest file read; those that this project writes have some kilobytes
MAX_DEPTH = 50  # Most levels of nesting; files of this project have six

T = TypeVar("T")


class JsonError(ReconstructionPackageError, ValueError):
    """Content is no JSON, or not of the type expected; the message is one printable line."""

    def __init__(self, message: str) -> None:
        super().__init__(make_printable(message))


def format_json(content: Any) -> bytes:
    """Return strict JSON."""
    return f"{json.dumps(content, indent=2, allow_nan=False)}\n".encode()


def write_json(path: Path, content: Any) -> None:
    """Write a file of strict JSON, atomically."""
    write_file(path, format_json(content))


def read_json(path: str | os.PathLike[str]) -> Any:
    """Read a JSON file as plain content."""
    path = Path(path)
    try:
        if not path.is_file():
            raise JsonError("there is no such file")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise JsonError(f"larger than {MAX_FILE_BYTES // 2**20} MB")
        return parse_json(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise JsonError(f"cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise JsonError(f"cannot be read as JSON ({error})") from error


def parse_json(text: str) -> Any:
    """Return JSON text as plain content."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise JsonError(f"cannot be read as JSON ({error})") from error
    _check(content)
    return content


def as_type(content: Any, kind: type[T], where: str = "", *, others_allowed: bool = False) -> T:
    """Return plain content as a value of a type: dataclasses of objects, tuples of lists, floats of integers."""
    try:
        value = msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        raise JsonError(_describe(error, where)) from error
    except UnicodeEncodeError:  # text that is no Unicode, where msgspec wants none
        content = json.loads(json.dumps(content, ensure_ascii=False).encode("utf-8", "replace"))
        return as_type(content, kind, where, others_allowed=others_allowed)
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
    """Refuse what msgspec accepts: fields that a dataclass does not have."""
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


def _check(content: Any, where: str = "", depth: int = 0) -> None:
    """Refuse NaN and infinities, which Python reads and JSON does not have, and what would exhaust a stack."""
    if depth > MAX_DEPTH:
        raise JsonError(f"{where} is nested deeper than {MAX_DEPTH} levels")
    if isinstance(content, dict):
        for name, inner in content.items():
            _check(inner, f"{where}.{name}".lstrip("."), depth + 1)
    elif isinstance(content, list):
        for index, inner in enumerate(content):
            _check(inner, f"{where}[{index}]", depth + 1)
    elif isinstance(content, float) and not math.isfinite(content):
        raise JsonError(f"{where or 'it'} is {content}; a finite number is needed")
