"""What a user wrote, as files keep it: by "module:name", fields and version, imported again when it is needed.

Reading a file imports nothing. Only `Stored.restore`, which continuing a run calls, does, and only modules that the
caller allows.
"""

import hashlib
import inspect
import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import FunctionType
from typing import Any

from evolution._src.errors import RunError
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks import storage

MAX_SEED = 2**32 - 1  # What NumPy's `RandomState` takes
MAX_MODULES = 50  # As in the environment
MAX_GENERATIONS = 10**9
MAX_GENOTYPES = 100_000
MAX_TRIALS = 10_000
MAX_WORKERS = 10_000
MAX_MAGNITUDE = 1e9  # Far beyond any useful gene, fitness or weight
MIN_POSITIVE = 1e-9  # Smallest value of what must be above 0: step sizes, shares
OWN_PACKAGES = ("evolution", "symbrion_gym", "reconstruction")  # Packages whose versions a run keeps anyway
_VERSION_LENGTH = 16


@dataclass(frozen=True)
class Stored:
    """What a file says of a task, a scoring or recorders of a user; nothing of it is imported yet."""

    text: str  # JSON text of what `store` returned

    def restore(self, what: str, allow: Collection[str] = ()) -> Any:
        """Return the value; of code that is not of this project only modules in `allow` are imported."""
        content = json.loads(self.text)
        with refuse(what, AttributeError, KeyError, TypeError):
            for name, version in content.get("versions", {}).items():
                check_allowed(name, what, allow)
                now = find_version(find_object(name, what), what)
                if now != version:
                    raise RunError(
                        f"{what} {name} has changed: version {now!r}, not {version!r} as recorded; restore it, or "
                        "begin another run (an attribute `version` of its own says which changes matter)"
                    )
            return storage.restore(content["value"], allow)


def store(value: Any, what: str) -> dict[str, Any]:
    """Return JSON content of which `Stored` restores an equal value, and the versions of what a user wrote in it."""
    with refuse(f"{what}: {value!r} cannot be restored by another process:"):
        content = storage.describe(value)
        if is_dataclass(value) and vars(value).keys() - {each.name for each in fields(value)}:
            raise TaskError("it has a state beyond its fields")
    versions = {name: find_version(find_object(name, what), what) for name in _list_names(content)}
    return {"value": content, "versions": versions}


@contextmanager
def refuse(what: str, *errors: type[Exception]) -> Iterator[None]:
    """Raise an error of what names code as one of a run, which begins with what it is for."""
    try:
        yield
    except (TaskError, *errors) as error:
        raise RunError(f"{what} {error}") from error


def _list_names(content: Any) -> list[str]:
    """Return "module:name" of each class and function in what `describe` returned that is not of this project."""
    if isinstance(content, list):
        return [name for each in content for name in _list_names(each)]
    if not isinstance(content, dict):
        return []
    name = content.get("type", content.get("function", ""))
    own = [name] if isinstance(name, str) and name.partition(".")[0] not in (*OWN_PACKAGES, "") else []
    return _list_names(list(content.values())) + own


def check_allowed(name: str, what: str, allow: Collection[str]) -> None:
    """Refuse to import what a file names, unless the caller has allowed its module."""
    with refuse(what):
        storage.check_allowed(name, allow)


def find_object(name: str, what: str) -> Any:
    """Import the function or class that "module:name" names."""
    found = find_value(name, what)
    if not isinstance(found, FunctionType | type):
        raise RunError(f"{what} {name} is no function or class of that module")
    return found


def find_value(name: str, what: str) -> Any:
    """Import what "module:name" names."""
    with refuse(what):
        return storage.find_value(name)


def find_version(owner: Any, what: str) -> str:
    """Return the version of a function or class: its own, otherwise a digest of the source of its module."""
    own = getattr(owner, "version", None)
    if isinstance(own, str | int):
        return str(own)
    try:
        source = Path(inspect.getsourcefile(owner) or "").read_bytes()
    except (OSError, TypeError) as error:
        name = f"{owner.__module__}:{owner.__qualname__}"
        raise RunError(f"{what} {name} has no source; give it an attribute `version`") from error
    return hashlib.sha256(source).hexdigest()[:_VERSION_LENGTH]
