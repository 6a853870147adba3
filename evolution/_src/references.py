"""References to what a user wrote: a file keeps "module:name" and a version, and it is imported again when needed.

Reading a file imports nothing. Only `Reference.restore`, which continuing a run calls, does.
"""

import dataclasses
import hashlib
import importlib
import inspect
import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType
from typing import Any

from evolution._src.errors import RunError
from reconstruction._src.base.typed_json import JsonError, as_type
from symbrion_gym._src.tasks.storage import is_allowed

OWN_PACKAGES = ("evolution", "symbrion_gym", "reconstruction")  # Packages whose versions a run keeps anyway
_VERSION_LENGTH = 16
_ADVICE = "use a function, or a frozen dataclass whose fields are numbers, text and tuples of these"


@dataclass(frozen=True)
class Reference:
    """What a file says of a function, a class or an instance."""

    name: str  # "module:name" of the function or class
    # its attribute `version`, otherwise a digest of the source of its module; "" for those of this project
    version: str = ""
    fields: str | None = None  # JSON text of the fields of an instance; None for the function or class itself

    def to_json(self) -> dict[str, Any]:
        """Return JSON content."""
        content = {"name": self.name, "version": self.version}
        return content if self.fields is None else content | {"fields": json.loads(self.fields)}

    @classmethod
    def from_json(cls, content: Any, what: str) -> "Reference":
        """Return what `to_json` described, without importing it."""
        if not isinstance(content, dict) or not isinstance(content.get("fields", {}), dict):
            raise RunError(f"{what} is {content!r}; an object with name, version and fields is needed")
        text = {"fields": json.dumps(content["fields"], sort_keys=True)} if "fields" in content else {}
        try:
            return as_type(content | text, cls, what)
        except JsonError as error:
            raise RunError(str(error)) from error

    def restore(self, what: str, allow: Collection[str] = ()) -> Any:
        """Import it."""
        check_allowed(self.name, what, allow)
        found = find_object(self.name, what)
        version = find_version(found, what)
        if version != self.version:
            raise RunError(
                f"{what} {self.name} has changed: version {version!r}, not {self.version!r} as recorded; restore it, "
                "or begin another run (an attribute `version` of its own says which changes matter)"
            )
        if self.fields is None:
            return found
        if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
            raise RunError(f"{what} {self.name} is no dataclass, though fields of an instance are recorded")
        try:
            return as_type(json.loads(self.fields), found, what)
        except (TypeError, ValueError, NameError) as error:
            raise RunError(f"{what} {self.name} cannot be made of the recorded fields: {error}") from error


def refer(value: object, what: str) -> Reference:
    """Return a reference that restores a function, a class, or an instance of a dataclass."""
    is_named = isinstance(value, FunctionType | type)
    owner: Any = value if is_named else type(value)
    name = f"{owner.__module__}:{owner.__qualname__}"
    if owner.__module__ == "__main__" or "<" in name or _look_up(name) is not owner:
        raise RunError(
            f"{what} {name} cannot be restored: another process cannot import it; "
            "define it at the top level of a module of its own and import it from there"
        )
    if not (is_named or dataclasses.is_dataclass(value)):
        raise RunError(f"{what} is an instance of {name} and cannot be restored; {_ADVICE}")
    reference = Reference(name, find_version(owner, what))
    return reference if is_named else _add_fields(reference, value, what)


def _add_fields(reference: Reference, value: Any, what: str) -> Reference:
    try:
        reference = dataclasses.replace(reference, fields=json.dumps(_read_fields(value), sort_keys=True))
        restored = reference.restore(what, (owner_module(reference.name),))
        is_same = bool(vars(restored) == vars(value))
    except (TypeError, ValueError, RunError) as error:
        raise RunError(f"{what} {reference.name} cannot be restored ({error}); {_ADVICE}") from error
    if not is_same:
        raise RunError(
            f"{what} {reference.name} has a state beyond its fields and cannot be restored; {_ADVICE}"
        )
    return reference


def _read_fields(value: Any) -> dict[str, Any]:
    names = [each.name for each in dataclasses.fields(value) if each.init]
    full = dataclasses.asdict(value)
    return {name: full[name] for name in names}


def owner_module(name: str) -> str:
    """Return the module of "module:name"."""
    return name.partition(":")[0]


def check_allowed(name: str, what: str, allow: Collection[str]) -> None:
    """Refuse to import what a file names, unless the caller has allowed its module."""
    module = owner_module(name)
    if not is_allowed(module, allow):
        raise RunError(
            f"{what} {name} is code that a file names, and none is run unless it is allowed: "
            f"--allow-code {module}, in Python allow=({module!r},)"
        )


def find_object(name: str, what: str) -> Any:
    """Import the function or class that "module:name" names."""
    found = find_value(name, what)
    if not isinstance(found, FunctionType | type):
        raise RunError(f"{what} {name} is no function or class of that module")
    return found


def find_value(name: str, what: str) -> Any:
    """Import what "module:name" names; None where the module has no such name."""
    module, _, qualname = name.partition(":")
    if not module or not qualname:
        raise RunError(f"{what} is {name!r}; give 'module:name'")
    try:
        importlib.import_module(module)
    except Exception as error:  # importing runs code of the user
        raise RunError(f"{what} {name} cannot be imported: {error}; is its folder on PYTHONPATH?") from error
    return _look_up(name)


def _look_up(name: str) -> object:
    module, _, qualname = name.partition(":")
    try:
        found: Any = importlib.import_module(module)
        for part in qualname.split("."):
            found = getattr(found, part)
    except Exception:  # as above
        return None
    return found


def find_version(owner: Any, what: str) -> str:
    """Return the version of a function or class: its own, otherwise a digest of the source of its module."""
    if owner.__module__.partition(".")[0] in OWN_PACKAGES:
        return ""
    own = getattr(owner, "version", None)
    if isinstance(own, str | int):
        return str(own)
    try:
        source = Path(inspect.getsourcefile(owner) or "").read_bytes()
    except (OSError, TypeError) as error:
        raise RunError(
            f"{what} {owner.__module__}:{owner.__qualname__} has no source; give it an attribute `version`"
        ) from error
    return hashlib.sha256(source).hexdigest()[:_VERSION_LENGTH]


def find_versions(content: Any, what: str) -> dict[str, str]:
    """Return name -> version of all that is not of this project in JSON content of
    `symbrion_gym._src.tasks.storage`."""
    if isinstance(content, list):
        return {name: each for inner in content for name, each in find_versions(inner, what).items()}
    if not isinstance(content, dict):
        return {}
    found = find_versions(list(content.values()), what)
    name = content.get("type", content.get("function"))
    if isinstance(name, str) and name.partition(".")[0].partition(":")[0] not in OWN_PACKAGES:
        found[name] = find_version(_look_up(name), what)
    return found


def check_versions(versions: Mapping[str, str], what: str, allow: Collection[str]) -> None:
    """Refuse other versions than those recorded."""
    for name, version in versions.items():
        check_allowed(name, what, allow)
        now = find_version(find_object(name, what), what)
        if now != version:
            raise RunError(
                f"{what}: {name} has changed: version {now!r}, not {version!r} as recorded; restore it, or begin "
                "another run (an attribute `version` of its own says which changes matter)"
            )


def check_signature(function: Callable[..., Any], what: str, *names: str) -> None:
    """Refuse what is no function of so many positional arguments."""
    try:
        inspect.signature(function).bind(*names)
    except (TypeError, ValueError) as error:
        raise RunError(
            f"{what} is {function!r}; a function of ({', '.join(names)}) is needed ({error})"
        ) from error


MAX_SEED = 2**32 - 1  # What NumPy's `RandomState` takes
MAX_MODULES = 50  # As in the environment
MAX_GENERATIONS = 10**9
MAX_GENOTYPES = 100_000
MAX_TRIALS = 10_000
MAX_WORKERS = 10_000
MAX_MAGNITUDE = 1e9  # Far beyond any useful gene, fitness or weight
MIN_POSITIVE = 1e-9  # Smallest value of what must be above 0: step sizes, shares
