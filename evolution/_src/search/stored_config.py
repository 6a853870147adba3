"""A configuration as JSON: fields of parts side by side, as in every version; what a user wrote by reference."""

import json
from collections.abc import Callable, Collection
from dataclasses import asdict, is_dataclass, replace
from typing import Any, TypeVar

from evolution._src.backends.nested import Nested, Options
from evolution._src.backends.parts import Point
from evolution._src.backends.scoring import StoredDescriptors, descriptors_to_json
from evolution._src.backends.stored_task import StoredTask, task_to_json
from evolution._src.backends.trials import Randomization, RolloutConfig
from evolution._src.controllers.controller import ControllerConfig
from evolution._src.controllers.finding import controller_to_json
from evolution._src.controllers.source import ControllerSource
from evolution._src.errors import RunError
from evolution._src.references import Reference, refer
from reconstruction._src.base.typed_json import JsonError, as_type
from symbrion_gym._src.robot.organism import Organism

Kinds = dict[str, Any]
"""Name of a field -> type of its JSON content. In place of the scoring a user may give a function or another class, of
which a file keeps name, version and fields."""
SHARED_KINDS: Kinds = {
    "modules": int,
    "organism": Organism | None,
    "task": str | dict[str, Any] | None,
    "start": str | Point | None,
    "goal": str | Point | None,
    "environment": Options,
    "controller": str | dict[str, Any],
    "controller_config": ControllerConfig,
    "origin": str,
    "randomization": Randomization,
    "rollout": RolloutConfig,
    "descriptors": list[Any],
}
"""Of the parts that several configurations have."""

N = TypeVar("N", bound=Nested)
DictFactory = Callable[[list[tuple[str, Any]]], dict[str, Any]]


def to_json(config: Nested, kinds: Kinds, dict_factory: DictFactory = dict) -> dict[str, Any]:
    """Return JSON content of the fields of a configuration."""
    pairs = [
        (name, _describe(name, value, kinds[name], dict_factory)) for name, value in config.flatten().items()
    ]
    return dict_factory(pairs)


def drop_none(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object without the entries that are None."""
    return {name: value for name, value in pairs if value is not None}


def to_text(content: Any, *, is_sorted: bool = False) -> str:
    """Return JSON text."""
    try:
        return json.dumps(content, sort_keys=is_sorted)
    except TypeError as error:
        raise RunError(f"environment: {error}, and a run is stored as text; use numbers and names") from error


def _describe(name: str, value: Any, kind: Any, dict_factory: DictFactory) -> Any:
    if isinstance(kind, type) and is_dataclass(kind):
        if type(value) is kind:
            return asdict(value, dict_factory=dict_factory)
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


def read_content(content: object, kinds: Kinds, where: str) -> dict[str, Any]:
    """Return the fields that JSON content describes; this imports nothing."""
    lead = f"{where}." if where else ""
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


def restore(config: N, allow: Collection[str] = ()) -> N:
    """Return a configuration with what a user wrote imported again."""
    changes: dict[str, Any] = {}
    for name, value in config.flatten().items():
        if isinstance(value, Reference | StoredDescriptors):
            changes[name] = value.restore(name, allow)
        elif isinstance(value, StoredTask):
            changes[name] = value.restore(allow)
        elif isinstance(value, ControllerSource):
            changes[name] = value.allow(allow)
    return replace(config, **changes) if changes else config  # pyright: ignore[reportArgumentType]
