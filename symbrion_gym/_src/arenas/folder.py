"""An arena as a folder: `arena.xml` for MuJoCo's viewer, OBJ meshes, `arena.json` with where it came from.

arena.xml            contact pieces and surface; drag it into MuJoCo's viewer
arena.json           name, kind, friction, quality, provenance; of exact arenas their course
surface.obj          the exact surface, to 0.1 mm; with the colors of its vertices where there are any
surface.png          its texture, where it has colors
pieces/000.obj ...   the contact pieces, to 1 µm
height_field.npz     in place of pieces, for the kind "hfield"

While an arena takes the place of another, its meshes lie in `.arena/`; `arena.json` says where (`saving`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from reconstruction._src.base.bounded_read import read_npz
from symbrion_gym._src.arenas.checks import check_height_field, check_piece, check_surface
from symbrion_gym._src.arenas.description import load_description
from symbrion_gym._src.arenas.obj_mesh import load_colored_obj, load_obj
from symbrion_gym._src.arenas.png import load_png
from symbrion_gym._src.arenas.texture import SurfaceTexture
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError


def load_arena_folder(folder: str | Path) -> dict[str, Any]:
    """Return the fields of the arena in a folder."""
    folder = Path(folder)
    fields, files = load_description(folder / "arena.json")
    surface, uv = load_colored_obj(files.surface)
    pieces = [load_obj(path) for path in files.pieces]
    check_surface(surface, files.surface)
    texture = None
    if files.texture is not None:
        texture = SurfaceTexture(load_png(files.texture), np.zeros((0, 3, 2)) if uv is None else uv)
    for piece, path in zip(pieces, files.pieces, strict=True):
        check_piece(piece, path)
    height_field = None if files.height_field is None else _load_height_field(files.height_field)
    shapes = {"surface": surface, "pieces": pieces, "height_field": height_field}
    return fields | shapes | ({} if texture is None else {"texture": texture})


def _load_height_field(path: Path) -> HeightField:
    try:
        arrays = read_npz(path, HeightField._fields)
        field = HeightField(*(arrays[name] for name in HeightField._fields))
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise ArenaError(f"{path}: damaged ({error}); build the arena again with make_arena") from error
    check_height_field(field, path)
    return field
