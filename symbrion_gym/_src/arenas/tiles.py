"""An arena of the part of a large scan that a robot is in."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.tiles.folder import TiledSurface
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.errors import ArenaError


def load_tiles(
    folder: str | Path, center: ArrayLike | None = None, radius: float = 25.0, **options: Any
) -> Arena:
    """Return an arena of the tiles around a place; the others are not read.

    Args:
        folder: a folder by `rc.reconstruct_tiles` or `symbrion reconstruct --tile`.
        center: (x, y) of the place, in the frame of the tiles: coordinates of the scan minus the offset [m]; None: the
            middle of all tiles.
        radius: tiles that a circle of this radius touches are part of the arena, whole [m].
        options: options of `make_arena`.

    Raises:
        ArenaError: no tiles, or none near; or the arena cannot be built.
    """
    try:
        tiles = TiledSurface.load(folder)
        mesh = tiles.mesh(center, radius)
    except ReconstructionError as error:
        raise ArenaError(str(error)) from error
    arena = make_arena(mesh, **{"name": Path(folder).resolve().name, **options})
    about: dict[str, Any] = {"provenance": arena.provenance | {"offset": list(tiles.offset)}}
    if any(field.name == "offset" for field in dataclasses.fields(arena)):
        about["offset"] = tiles.offset
    return dataclasses.replace(arena, **about)
