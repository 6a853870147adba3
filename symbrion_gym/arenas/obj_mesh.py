"""The OBJ files of an arena's folder: vertices and triangles, nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction.files.printable import make_printable
from symbrion_gym.errors import ArenaError

_LARGEST = 2**30
"""Bytes of one mesh; a million faces take 0.06 GB."""


def load_obj(path: Path) -> trimesh.Trimesh:
    """Read a mesh exactly as the file has it.

    Raises:
        ArenaError: missing, too large, or something else than vertices and triangles.
    """
    if not path.is_file():
        raise ArenaError(f"{path} is missing; build the arena again with make_arena")
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"larger than {_LARGEST // 2**30} GB")
        vertices, faces = _parse(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, OverflowError) as error:
        raise ArenaError(
            f"{path}: not a mesh of triangles ({make_printable(error, 200)}); build the arena again with make_arena"
        ) from error
    return trimesh.Trimesh(vertices, faces, process=False)


def _parse(text: str) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Return vertices and faces."""
    rows: dict[str, list[list[str]]] = {"v": [], "f": []}
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind in rows:
            rows[kind].append(rest.split())
    for kind, name in (("v", "vertex"), ("f", "face")):
        wrong = next((row for row in rows[kind] if len(row) != 3), None)
        if wrong is not None:
            raise ValueError(f"the {name} {' '.join(wrong)!r} has {len(wrong)} entries, not 3")
    vertices = np.array(rows["v"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(rows["f"], dtype=np.int64).reshape(-1, 3) - 1
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError("a face names a vertex that is not there")
    return vertices, faces
