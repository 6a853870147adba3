"""JSON files as a stranger may write them: every field of a good one with every evil value, absent, or doubled."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

DEEP = "[" * 500 + "]" * 500
EVIL = (
    "null",
    '"text"',
    '"\\u001b[2J\\n"',
    '"\\udcff"',
    '""',
    "[]",
    "[[]]",
    '{"wings": 2}',
    "true",
    "-1",
    "0.5",
)
EVIL += ("1e308", "-1e308", "1e999", "NaN", "-Infinity", "9" * 400, DEEP)
_MARK = "@here@"


class Mutant(NamedTuple):
    """A file with one thing wrong.

    Attributes:
        field: name of the field that was changed.
        value: what stands there now, "absent" or "unknown".
        text: the whole file.
    """

    field: str
    value: str
    text: str


def mutate(content: dict[str, Any]) -> Iterator[Mutant]:
    """Yield every mutant of a file's content: each field at each level replaced, absent, or one too many."""
    for keys in _find_fields(content):
        name = next(key for key in reversed(keys) if isinstance(key, str))
        text = json.dumps(_put(content, keys, _MARK))
        for value in EVIL:
            yield Mutant(name, value[:20], text.replace(f'"{_MARK}"', value))
        if isinstance(keys[-1], str):
            yield Mutant(name, "absent", json.dumps(_put(content, keys, None, remove=True)))
            yield Mutant("wings", "unknown", json.dumps(_put(content, (*keys[:-1], "wings"), 2)))


def find_trouble(mutants: Iterator[Mutant], path: Path, load: Callable[[], Any], error: type) -> list[str]:
    """Load each mutant; return what came of those that neither load nor are refused as they should.

    A refusal is the package's own error, one printable line with the names of file and field.
    """
    troubles = []
    for mutant in mutants:
        path.write_text(mutant.text)
        try:
            load()
        except error as refusal:
            said = str(refusal)
            if not (said.isprintable() and path.name in said and mutant.field in said and len(said) < 1000):
                troubles.append(f"{mutant.field} = {mutant.value}: says {said[:300]!r}")
        except Exception as other:
            troubles.append(f"{mutant.field} = {mutant.value}: {type(other).__name__} {str(other)[:200]!r}")
    return troubles


def _find_fields(content: Any, keys: tuple = ()) -> Iterator[tuple]:
    items = content.items() if isinstance(content, dict) else enumerate(content[:1])
    for key, value in items:
        yield (*keys, key)
        if isinstance(value, dict | list):
            yield from _find_fields(value, (*keys, key))


def _put(content: Any, keys: tuple, value: Any, remove: bool = False) -> Any:
    copy = json.loads(json.dumps(content))
    inner = copy
    for key in keys[:-1]:
        inner = inner[key]
    if remove:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return copy
