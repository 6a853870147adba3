"""Arenas of files, built once in a process and with progress: those of a mesh may take minutes."""

from collections import OrderedDict
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.assets import NAMED_ARENAS

if TYPE_CHECKING:
    from evolution._src.backends.trials import ArenaSource
    from symbrion_gym._src.arenas.arena import Arena

MAX_ARENAS = 4
"""Arenas that a process keeps."""
_arenas: "OrderedDict[tuple[str, int], Arena]" = OrderedDict()


def find_arena_key(arena: "ArenaSource") -> object:
    """Return what tells arenas apart: a name, a path and when it was written, or the identity of an `Arena`."""
    if not isinstance(arena, str | PathLike):
        return id(arena)
    return arena if arena in NAMED_ARENAS else (str(arena), _find_time(Path(arena)))


def prepare_arena(arena: "ArenaSource", progress: Progress = silent) -> "ArenaSource":
    """Return an arena, loaded or built where it is a file or a folder; the next call returns the same one."""
    if not isinstance(arena, str | PathLike) or arena in NAMED_ARENAS:
        return arena
    key = str(arena), _find_time(Path(arena))
    if key not in _arenas:
        from symbrion_gym._src.arenas.loading import load_arena

        found = load_arena(str(arena), progress=progress)
        while len(_arenas) >= MAX_ARENAS:
            _arenas.popitem(last=False)
        _arenas[key] = found
    _arenas.move_to_end(key)
    return _arenas[key]


def _find_time(path: Path) -> int:
    """Return when an arena was written [ns]; 0 where there is none."""
    try:
        return (path / "arena.json" if path.is_dir() else path).stat().st_mtime_ns
    except OSError:
        return 0
