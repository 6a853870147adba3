"""Arguments that several subcommands take: arenas, boxes, point sources."""

from pathlib import Path

import symbrion_gym as sg
from evolution.cli.command import UsageError


def check_arena(arena: str) -> None:
    """Refuse an arena that is neither a name we know nor a file or folder."""
    if arena in sg.NAMED_ARENAS or Path(arena).exists():
        return
    raise UsageError(
        f"no arena '{arena}'; there are {', '.join(sg.NAMED_ARENAS)}, or give an arena folder or a mesh file"
    )


def check_arena_folder(arena: str) -> None:
    """Refuse a damaged arena folder before anything is written; meshes are read when they are needed.

    Raises:
        ArenaError: the message names file and field.
    """
    if arena not in sg.NAMED_ARENAS and Path(arena).is_dir():
        sg.load_arena(arena)


def check_modules(modules: int) -> None:
    """Refuse a body of fewer than two modules: it has no hinge that could be controlled."""
    if modules < 2:
        raise UsageError(f"--modules {modules} is no snake; give 2 or more")
