"""Constants of a module with other values for a while."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import pytest


@contextmanager
def with_constants(module: ModuleType, **values: Any) -> Iterator[None]:
    """Give constants other values: `step=1.0` is `_STEP`, or `STEP`, of the module."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in values.items():
            found = next(each for each in (f"_{name.upper()}", name.upper()) if hasattr(module, each))
            patch.setattr(module, found, value)
        yield
