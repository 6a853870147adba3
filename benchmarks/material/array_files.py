"""Arrays that go from one process to another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from reconstruction._src.base.atomic_write import write_atomically


def save_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Write arrays as one .npz file; those that are None are left out."""
    held = {name: array for name, array in arrays.items() if array is not None}
    with write_atomically(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **held)


def load_arrays(path: Path) -> dict[str, Any]:
    """Read all arrays of an .npz file."""
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}
