"""Control laws compute with NumPy on the host and with JAX on a device: which of both, and what differs."""

from __future__ import annotations

from typing import Any

import numpy as np


def find_namespace(array: Any) -> Any:
    """Return NumPy for its arrays, and `jax.numpy` for those of JAX."""
    return np if isinstance(array, np.ndarray) else array.__array_namespace__()


def add_to_column(array: Any, column: int, values: Any) -> Any:
    """Return an array with values added to a column; of NumPy, it is the same array."""
    if isinstance(array, np.ndarray):
        array[:, column] += values
        return array
    return array.at[:, column].add(values)
