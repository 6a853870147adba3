"""Configurations made of parts, whose fields can also be given and read as if they were the configuration's own."""

import functools
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, fields, replace
from typing import Any, ClassVar

from evolution._src.errors import RunError
from symbrion_gym._src.environment.config import EnvironmentConfig


class Nested:
    """Base of frozen dataclasses (`init=False`) of parts.

    A part is a field that is named in `PARTS` and whose default is made by a dataclass. `Run(modules=5)` is the same as
    `Run(body=BodyConfig(modules=5))`, `run.modules` as `run.body.modules`, and `dataclasses.replace(run, modules=6)`
    works. Of a part and a field of it that are both given, the field counts.

    Args:
        arguments: values of the fields in `POSITIONAL`.
        values: fields, and fields of parts; what is neither goes to `take_others`.

    Raises:
        TypeError: a field that is needed is missing.
    """

    PARTS: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that are parts."""
    POSITIONAL: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that may be given without a name, in order."""

    def __init__(self, *arguments: Any, **values: Any) -> None:
        if len(arguments) > len(self.POSITIONAL):
            raise TypeError(f"{type(self).__name__} takes {len(self.POSITIONAL)} fields without a name")
        values |= dict(zip(self.POSITIONAL, arguments, strict=False))
        self.check_given(values)
        names = self.list_names()
        others = {name: values.pop(name) for name in list(values) if name not in names}
        for each in fields(self):  # pyright: ignore[reportArgumentType]
            own = {
                name: values[name]
                for name in _list_part(type(self), each)
                if name in values and _find_holder(type(self), name) == each.name
            }
            value = values.get(each.name, MISSING)
            value = _make_default(each, type(self).__name__) if value is MISSING else value
            object.__setattr__(self, each.name, replace(value, **own) if own else value)
        self.take_others(others)
        self.__post_init__()

    def __post_init__(self) -> None:
        """Check the fields."""

    def check_given(self, values: Mapping[str, Any]) -> None:
        """Refuse values that were given together and contradict each other; a default is not among them."""

    def take_others(self, others: dict[str, Any]) -> None:
        """Take values that no field has."""
        if others:
            name = type(self).__name__
            raise TypeError(
                f"{name} has no field {', '.join(others)}; there are: {', '.join(self.list_names())}"
            )

    def __getattr__(self, name: str) -> Any:
        holder = _find_holder(type(self), name)
        if holder is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(getattr(self, holder), name)

    @classmethod
    def list_names(cls) -> list[str]:
        """Return the names of the fields and of those of the parts."""
        return [name for each in fields(cls) for name in (each.name, *_list_part(cls, each))]  # pyright: ignore[reportArgumentType]

    def flatten(self) -> dict[str, Any]:
        """Return the values of all fields, those of parts in place of the parts."""
        return {
            name: getattr(self, name)
            for each in fields(self)  # pyright: ignore[reportArgumentType]
            for name in _list_part(type(self), each) or (each.name,)
        }

    def set_field(self, name: str, value: Any) -> None:
        """Set a field or a field of a part; only while it is made."""
        holder = _find_holder(type(self), name)
        part = value if holder is None else replace(getattr(self, holder), **{name: value})
        object.__setattr__(self, holder or name, part)


def _list_part(cls: type[Nested], each: Field[Any]) -> tuple[str, ...]:
    """Return the names of the fields of a part; none for a field that is no part."""
    if each.name not in cls.PARTS:
        return ()
    factory: Any = each.default_factory
    kind: Any = factory.func if isinstance(factory, functools.partial) else factory
    return tuple(inner.name for inner in fields(kind))


def _make_default(each: Field[Any], owner: str) -> Any:
    if each.default is not MISSING:
        return each.default
    if each.default_factory is not MISSING:
        return each.default_factory()
    raise TypeError(f"{owner} needs {each.name}")


@functools.cache
def _find_holder(cls: type[Nested], name: str) -> str | None:
    """Return the name of the part that has a field; None where none has."""
    for each in fields(cls):  # pyright: ignore[reportArgumentType]
        if name in _list_part(cls, each):
            return each.name
    return None


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
