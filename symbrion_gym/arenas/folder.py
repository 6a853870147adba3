"""An arena as a folder: `arena.xml` for MuJoCo's viewer, OBJ meshes, `arena.json` with where it came from.

arena.xml            contact pieces and surface; drag it into MuJoCo's viewer
arena.json           name, kind, friction, course, quality, provenance
surface.obj          the exact surface, to 0.1 mm
pieces/000.obj ...   the contact pieces, to 1 µm
height_field.npz     in place of pieces, for the kind "hfield"
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from reconstruction.bounded_read import read_npz
from symbrion_gym.arenas.checks import check_height_field, check_piece, check_surface
from symbrion_gym.arenas.contact_kinds import HeightField
from symbrion_gym.arenas.description import FORMAT, load_description
from symbrion_gym.arenas.obj_mesh import load_obj
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


def load_arena_folder(folder: str | Path) -> dict[str, Any]:
    """Return the fields of the arena in a folder.

    Raises:
        ArenaError: it holds no arena, or a damaged one; the message names file and field.
    """
    folder = Path(folder)
    fields, files = load_description(folder / "arena.json")
    surface, pieces = load_obj(files.surface), [load_obj(path) for path in files.pieces]
    check_surface(surface, files.surface)
    for piece, path in zip(pieces, files.pieces, strict=True):
        check_piece(piece, path)
    height_field = None if files.height_field is None else _load_height_field(files.height_field)
    return fields | {"surface": surface, "pieces": pieces, "height_field": height_field}


def _load_height_field(path: Path) -> HeightField:
    try:
        arrays = read_npz(path, HeightField._fields)
        field = HeightField(*(arrays[name] for name in HeightField._fields))
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise ArenaError(f"{path}: damaged ({error}); build the arena again with make_arena") from error
    check_height_field(field, path)
    return field


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
