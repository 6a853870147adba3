"""Where a controller of a user is found again: by "module:name" and version, in records, workers and clusters."""

from __future__ import annotations

import dataclasses
import inspect
import sys
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any

from evolution._src.errors import RunError
from evolution._src.references import check_allowed, find_value, split_name
from reconstruction._src.base.typed_json import JsonError, as_type

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

_PLAIN = (bool, int, float, str, type(None))  # Types of arguments that a record can hold
_ADVICE = 'give a class or function of the organism that a module defines, or "module:name" of one'


@dataclasses.dataclass(frozen=True)
class ControllerSource:
    """A controller of a user, by reference. It can be hashed, compared, pickled and written as JSON."""

    name: str  # name of the controller
    version: str  # its version when the run began
    source: str  # "module:name" of a controller, or of a class or function of the organism that returns one
    # fields of a dataclass that `source` names; None for a class or function of the organism
    arguments: tuple[tuple[str, Any], ...] | None = None
    # whether its module may be imported; not where a file named it and nobody has allowed it since
    is_allowed: bool = dataclasses.field(default=True, compare=False)

    def __post_init__(self) -> None:
        split_name(self.source, "controller")
        if self.arguments is not None:
            arguments = tuple((str(name), _freeze(value)) for name, value in self.arguments)
            object.__setattr__(self, "arguments", arguments)

    def make(self, organism: Organism, num_tracks: int) -> Any:
        """Return the controller for a body."""
        if not self.is_allowed:
            check_allowed(self.source, "controller", ())
        found = import_path(self.source)
        if self.arguments is not None:
            made = call_maker(lambda: found(**dict(self.arguments or ())), self.source)
        else:
            made = make_from(found, organism, num_tracks, self.source)
        version = getattr(made, "version", None)
        if version != self.version:
            raise RunError(
                f"controller {self.source!r} is of version {version!r}, the record of {self.version!r}; "
                "restore that version of its module, or start a new run"
            )
        return made

    def allow(self, modules: Collection[str]) -> ControllerSource:
        """Return the source that may be imported."""
        if not self.is_allowed:
            check_allowed(self.source, "controller", modules)
        return dataclasses.replace(self, is_allowed=True)

    def as_dict(self) -> dict[str, Any]:
        """Return plain JSON content; `read_source` reads it."""
        content: dict[str, Any] = {"name": self.name, "version": self.version, "source": self.source}
        return content if self.arguments is None else content | {"arguments": list(self.arguments)}


def read_source(content: Mapping[str, Any]) -> ControllerSource:
    """Return the source that `ControllerSource.as_dict` described, without importing anything."""
    try:
        given = {name: value for name, value in content.items() if name != "is_allowed"}
        return dataclasses.replace(as_type(given, ControllerSource, "controller"), is_allowed=False)
    except JsonError as error:
        raise RunError(str(error)) from error


def find_source(spec: Any, name: str, version: str) -> ControllerSource:
    """Return the reference to what a user gave as a controller: an object, a class, a function or "module:name"."""
    if isinstance(spec, str):
        return ControllerSource(name, version, spec)
    if isinstance(spec, type) or inspect.isroutine(spec):
        return ControllerSource(name, version, _find_path(spec, spec.__qualname__))
    for key, value in vars(sys.modules.get(type(spec).__module__, object)).items():
        if value is spec:
            return ControllerSource(name, version, _find_path(spec, key))
    if dataclasses.is_dataclass(spec):
        fields = [field for field in dataclasses.fields(spec) if field.init]
        arguments = tuple((field.name, _freeze(getattr(spec, field.name))) for field in fields)
        if all(map(_is_plain, arguments)):
            return ControllerSource(name, version, _find_path(type(spec), type(spec).__qualname__), arguments)
    raise RunError(
        f"controller {name!r} cannot be found again from a record or in a worker: it is an object that no module "
        f"names, and no dataclass of numbers and text; {_ADVICE}"
    )


def _find_path(thing: Any, qualname: str) -> str:
    """Return "module:name", by which an importable thing is found again."""
    module = thing.__module__ if hasattr(thing, "__module__") else type(thing).__module__
    what = f"controller {module}:{qualname}"
    if "<" in qualname:
        raise RunError(
            f"{what} is a lambda or defined inside a function, so that a record or worker cannot find it; {_ADVICE}"
        )
    if module == "__main__":
        raise RunError(
            f"{what} is defined in the program that runs, so that a record or worker cannot find it; "
            "move it into a module of its own and import it"
        )
    path = f"{module}:{qualname}"
    if import_path(path) is not thing:
        raise RunError(f"{what} has been replaced in its module, so that a record cannot find it; {_ADVICE}")
    return path


def import_path(path: str) -> Any:
    """Import what "module:name" names."""
    return find_value(path, "controller")


def make_from(found: Any, organism: Organism, num_tracks: int, what: str) -> Any:
    """Return a controller: what was found, or what it makes as a class or function of the organism."""
    if not isinstance(found, type) and hasattr(found, "act"):
        return found
    if not callable(found):
        raise RunError(f"controller {what!r} is {found!r}, which is no controller; {_ADVICE}")
    try:
        parameters = inspect.signature(found).parameters
    except (TypeError, ValueError):
        parameters = {"organism": None}
    if not parameters:
        return call_maker(found, what)
    options = {"num_tracks": num_tracks} if "num_tracks" in parameters else {}
    return call_maker(lambda: found(organism, **options), what)


def call_maker(make: Callable[[], Any], what: str) -> Any:
    """Return what a class or function of a user makes."""
    try:
        return make()
    except RunError:
        raise
    except Exception as error:
        raise RunError(f"controller {what!r} cannot be made: {type(error).__name__}: {error}") from error


def _freeze(value: Any) -> Any:
    return tuple(map(_freeze, value)) if isinstance(value, list | tuple) else value


def _is_plain(value: Any) -> bool:
    return all(map(_is_plain, value)) if isinstance(value, tuple) else isinstance(value, _PLAIN)
