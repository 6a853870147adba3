"""Exporting an arena: one folder that the simulators of others load without this package."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from symbrion_gym._src.arenas.export.content import Content, make_content, sample_heights
from symbrion_gym._src.arenas.export.documents import describe, make_notice, make_readme
from symbrion_gym._src.arenas.export.loaders import LOADERS
from symbrion_gym._src.arenas.export.mjcf import format_mjcf
from symbrion_gym._src.arenas.export.obj import format_obj
from symbrion_gym._src.arenas.export.saving import find_own_files, save_export
from symbrion_gym._src.arenas.export.urdf import format_urdf
from symbrion_gym._src.arenas.export.usd import format_usd
from symbrion_gym._src.arenas.geometry import ArenaGeometry
from symbrion_gym._src.arenas.placed_objects import format_objects
from symbrion_gym._src.errors import ArenaError

FORMATS: dict[str, Callable[[Content], dict[str, bytes]]] = {
    "mjcf": format_mjcf,
    "urdf": format_urdf,
    "usd": format_usd,
    "obj": format_obj,
}
"""Format -> the function that returns its files: name -> content."""


def export_arena(
    folder: str | Path, geometry: ArenaGeometry, to: str, max_vertices: int | None, **about: Any
) -> dict[str, Any]:
    """Write an arena as a folder for other simulators; of what is there, only a former export is replaced."""
    if to not in FORMATS:
        raise ArenaError(f"to is {to!r}; there are: {', '.join(FORMATS)}")
    folder = Path(folder)
    find_own_files(folder)  # refused before any work
    content = make_content(geometry, max_vertices, **about)
    files = FORMATS[to](content) | {name: text.encode() for name, text in LOADERS[to].items()}
    files["heights.npz"] = _format_arrays(sample_heights(geometry.surface))
    if content.objects:
        files["objects.json"] = format_objects(content.objects)
    files["README.md"] = make_readme(content, to).encode()
    files["NOTICE.txt"] = make_notice().encode()
    description = describe(content, to)
    save_export(folder, files, description)
    return description


def _format_arrays(arrays: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()
