"""Terms of a user whose results are checked, so that a wrong shape is told with the name of the term."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from symbrion_gym._src.errors import TaskError

_OURS = f"{__name__.partition('.')[0]}."
"""Functions of this package return what they should, and are called without a check, which saves time."""


@dataclass(frozen=True, eq=False)
class CheckedFunction:
    """A function of a `TaskState` whose result has one value for each simulation."""

    what: str  # name of the term, for the message
    function: Callable[[Any], Any]  # the function

    def __call__(self, state: Any) -> Any:
        """Return what the function returns."""
        value = self.function(state)
        shape, kind = np.shape(value), np.asarray(value).dtype.kind
        if shape != (state.num,) or kind not in "biuf":
            found = f"an array of shape {shape}" if kind in "biuf" else f"{value!r}"
            raise TaskError(
                f"{self.what} returned {found}; one number or truth value for each of {state.num} simulations, an "
                f"array of shape ({state.num},), is needed"
            )
        return value


def check_function(what: str, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function of a task as it is, or with a check of what it returns if a user wrote it."""
    plain = getattr(function, "__func__", function)
    named = plain if hasattr(plain, "__qualname__") else type(plain).__call__
    is_ours = str(getattr(named, "__module__", "")).startswith(_OURS)
    return function if is_ours else CheckedFunction(what, function)
