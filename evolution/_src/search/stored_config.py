"""A configuration as JSON: its fields, what a user wrote by reference."""

import hashlib
import json
from collections.abc import Collection
from dataclasses import asdict, fields, is_dataclass, replace
from os import PathLike
from typing import Any, TypeVar, get_type_hints

from evolution._src.backends.scoring import Scoring, StoredDescriptors, descriptors_to_json
from evolution._src.backends.settings import EpisodeConfig
from evolution._src.backends.stored_task import StoredTask, task_to_json
from evolution._src.controllers.finding import controller_to_json
from evolution._src.controllers.source import ControllerSource
from evolution._src.errors import RunError
from evolution._src.references import Reference, refer
from reconstruction._src.base.typed_json import JsonError, as_type

_OPEN_FIELDS: dict[str, Any] = {
    "arena": str,
    "modules": int,
    "task": str | dict[str, Any] | None,
    "controller": str | dict[str, Any],
    "scoring": Scoring,
    "descriptors": list[Any],
}
"""Types, in a file, of fields that take values of a user. In place of the scoring a user may give a function or another
class, of which a file keeps name, version and fields."""

C = TypeVar("C", bound=EpisodeConfig)


def check_text_fields(config: Any) -> None:
    """Take paths as text, and refuse an arena that no file could name."""
    for name in ("arena", "folder"):
        value = getattr(config, name)
        if isinstance(value, PathLike):
            object.__setattr__(config, name, str(value))
    if not isinstance(config.arena, str):
        raise RunError(
            f"arena is {type(config.arena).__name__}; a run is stored as text: save the arena in a folder and name that"
        )


def to_json(config: EpisodeConfig) -> dict[str, Any]:
    """Return JSON content of the fields of a configuration."""
    kinds = _list_kinds(type(config))
    content = {name: _describe(name, getattr(config, name), kind) for name, kind in kinds.items()}
    return json.loads(to_text(content | {"environment": dict(config.environment)}))


def compute_digest(config: EpisodeConfig, left_out: Collection[str]) -> str:
    """Return a fingerprint of all fields but some."""
    content = to_json(config) | {"start": config.find_start()}
    content = {name: value for name, value in content.items() if name not in left_out}
    return hashlib.sha256(to_text(content, is_sorted=True).encode()).hexdigest()


def to_text(content: Any, *, is_sorted: bool = False) -> str:
    """Return JSON text."""
    try:
        return json.dumps(content, sort_keys=is_sorted)
    except TypeError as error:
        raise RunError(f"environment: {error}, and a run is stored as text; use numbers and names") from error


def _list_kinds(cls: type[EpisodeConfig]) -> dict[str, Any]:
    """Return name and type of the fields of a configuration in a file."""
    kinds = get_type_hints(cls)
    return {each.name: _OPEN_FIELDS.get(each.name, kinds[each.name]) for each in fields(cls)}


def _describe(name: str, value: Any, kind: Any) -> Any:
    if isinstance(kind, type) and is_dataclass(kind):
        if type(value) is kind:
            return asdict(value)
        if name != "scoring":
            raise RunError(
                f"{name} is a {type(value).__qualname__}, which a file does not keep; use {kind.__name__}"
            )
        return (value if isinstance(value, Reference) else refer(value, name)).to_json()
    if name == "task":
        return task_to_json(value)
    if name == "controller":
        return controller_to_json(value)
    if name == "descriptors":
        return descriptors_to_json(value)
    if name == "organism":
        return None if value is None else asdict(value)
    return value


def read_content(content: object, cls: type[EpisodeConfig], where: str) -> dict[str, Any]:
    """Return the fields of a configuration that JSON content describes; this imports nothing."""
    lead, kinds = f"{where}." if where else "", _list_kinds(cls)
    if not isinstance(content, dict):
        raise RunError(f"{where or 'content'} is {content!r}; an object is needed")
    unknown = sorted(set(map(str, content)) - set(kinds))
    if unknown:
        raise RunError(f"{where or 'it'} has unknown entries {unknown}; there are {', '.join(kinds)}")
    return {name: _read_field(name, value, kinds[name], f"{lead}{name}") for name, value in content.items()}


def _read_field(name: str, value: Any, kind: Any, where: str) -> Any:
    if name == "scoring" and isinstance(value, dict) and "name" in value:
        return Reference.from_json(value, where)
    if name == "environment" and isinstance(value, dict):
        value = list(value.items())
    if name == "controller" and isinstance(value, str) and ":" in value:
        raise RunError(f"{where} is {value!r}; the name of a law, or an object with name, version and source")
    if name == "task" and isinstance(value, str) and ":" in value:
        raise RunError(f"{where} is {value!r}; the name of a task, or an object with type and fields")
    try:
        found = as_type(value, kind, where)
    except JsonError as error:
        raise RunError(str(error)) from error
    return StoredDescriptors(json.dumps(found, sort_keys=True)) if name == "descriptors" and found else found


def restore(config: C, allow: Collection[str] = ()) -> C:
    """Return a configuration with what a user wrote imported again."""
    changes: dict[str, Any] = {}
    for each in fields(config):
        name, value = each.name, getattr(config, each.name)
        if isinstance(value, Reference | StoredDescriptors):
            changes[name] = value.restore(name, allow)
        elif isinstance(value, StoredTask):
            changes[name] = value.restore(allow)
        elif isinstance(value, ControllerSource):
            changes[name] = value.allow(allow)
    return replace(config, **changes) if changes else config
