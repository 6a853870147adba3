"""Saving an arena as a folder; `folder` tells what lies in it."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from symbrion_gym.arenas.folder import FORMAT
from symbrion_gym.arenas.spec import make_arena_spec
from symbrion_gym.errors import ArenaError

if TYPE_CHECKING:
    from symbrion_gym.arenas.arena import Arena

_SURFACE_DIGITS, _PIECE_DIGITS = 4, 6


def save_arena(arena: Arena, folder: str | Path) -> None:
    """Write an arena as a folder; one that is there is replaced when the new one is complete.

    Raises:
        ArenaError: the folder holds something else than an arena.
    """
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()) and not (folder / "arena.json").is_file():
        raise ArenaError(f"{folder} is not empty and holds no arena; choose another folder")
    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        _write(arena, beside)
        beside.chmod(0o755)
        if folder.exists():
            shutil.rmtree(folder)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _write(arena: Arena, folder: Path) -> None:
    (folder / "pieces").mkdir()
    files = {"surface.obj": _format_obj(arena.surface, _SURFACE_DIGITS)}
    for i, piece in enumerate(arena.pieces):
        files[f"pieces/{i:03d}.obj"] = _format_obj(piece, _PIECE_DIGITS)
    for name, text in files.items():
        (folder / name).write_text(text)
    if arena.height_field is not None:
        np.savez_compressed(folder / "height_field.npz", **arena.height_field._asdict())
    about = {
        "format": FORMAT,
        "name": arena.name,
        "kind": arena.kind,
        "friction": arena.friction,
        "num_pieces": len(arena.pieces),
        "course": arena.course.as_dict() if arena.course is not None else None,
        "quality": arena.quality.as_dict(),
        "provenance": arena.provenance,
    }
    (folder / "arena.json").write_text(json.dumps(about, indent=2, allow_nan=False) + "\n")
    spec = make_arena_spec(arena, use_files=True)
    spec.assets = {name: text.encode() for name, text in files.items()}
    spec.compile()
    (folder / "arena.xml").write_text(spec.to_xml())


def _format_obj(mesh: trimesh.Trimesh, digits: int) -> str:
    # + 0.0 turns -0.0 into 0.0.
    vertices = np.round(np.asarray(mesh.vertices, dtype=np.float64), digits) + 0.0
    lines = [f"v {x:.{digits}f} {y:.{digits}f} {z:.{digits}f}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(mesh.faces) + 1).tolist()]
    return "\n".join(lines) + "\n"
