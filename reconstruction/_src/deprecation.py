"""Former names of public things: they work for one more version, with a warning that names the new one."""

import functools
import warnings
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


def accept_former_arguments(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function accept former names of its keyword arguments.

    Args:
        names: former name -> present name.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            for name in names.keys() & kwargs.keys():
                warn_renamed(name, names[name])
                kwargs[names[name]] = kwargs.pop(
                    name
                )  # `dataclasses.replace` passes both: the former one is meant
            return function(*args, **kwargs)

        return call

    return decorate


def accept_former_fields(**names: str) -> Callable[[C], C]:
    """Make a dataclass accept and have former names of its fields.

    Args:
        names: former name -> present name.
    """

    def decorate(cls: C) -> C:
        setattr(cls, "__init__", accept_former_arguments(**names)(cls.__init__))  # noqa: B010
        for former, present in names.items():
            setattr(cls, former, _make_property(former, present))
        return cls

    return decorate


def export_former_names(load: Callable[[str], Any], **names: str) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package that also has former names of what it exports.

    Args:
        load: the package's `__getattr__` for the present names.
        names: former name -> present name.
    """

    def load_either(name: str) -> Any:
        if name not in names:
            return load(name)
        warn_renamed(name, names[name])
        return load(names[name])

    return load_either


def rename_keys(content: Any, names: Mapping[str, str]) -> Any:
    """Return the JSON object of a file with present names for former ones; what is no object stays as it is."""
    if not isinstance(content, dict):
        return content
    return {names.get(name, name): value for name, value in content.items()}


def warn_renamed(former: str, present: str) -> None:
    """Warn whoever called the caller that a name has changed."""
    warnings.warn(f"{former} is now called {present}", DeprecationWarning, stacklevel=3)


def _make_property(former: str, present: str) -> property:
    def get(self: object) -> Any:
        warn_renamed(former, present)
        return getattr(self, present)

    return property(get, doc=f"Former name of `{present}`.")
