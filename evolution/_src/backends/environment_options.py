"""Further options of the environment, as a run and its champion store them: sorted pairs that can be hashed."""

from collections.abc import Iterable, Mapping
from typing import Any

from evolution._src.errors import RunError
from symbrion_gym._src.environment.config import EnvironmentConfig

Options = tuple[tuple[str, Any], ...]
"""Name and value of each option of the environment, sorted by name."""
OWN_FIELDS = ("arena", "modules", "organism", "task", "start")
"""Options of the environment that are fields of a configuration."""


def sort_options(options: Mapping[str, Any] | Iterable[tuple[str, Any]], task: object = None) -> Options:
    """Return options as sorted pairs, lists in them as tuples."""
    pairs = options.items() if isinstance(options, Mapping) else options
    found = tuple(sorted((str(name), _freeze(value)) for name, value in pairs))
    for name, value in found:
        if name in OWN_FIELDS:
            raise RunError(f"environment.{name} is {value!r}, which would be overwritten; give {name} itself")
        if not _is_hashable(value):
            raise RunError(f"environment.{name} is {value!r}; a number, text or list of these is needed")
    try:
        EnvironmentConfig.from_options(dict(found) | {"task": task})
    except (TypeError, ValueError) as error:
        raise RunError(f"environment: {error}") from error
    return found


def _freeze(value: Any) -> Any:
    return tuple(map(_freeze, value)) if isinstance(value, list | tuple) else value


def _is_hashable(value: Any) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True
