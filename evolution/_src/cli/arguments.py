"""Checks of arguments that several subcommands have: arenas, length of the snake."""

from pathlib import Path

from evolution._src.cli.command import UsageError
from symbrion_gym._src.assets import NAMED_ARENAS


def check_arena(arena: str) -> None:
    """Refuse an arena that is neither the name of a ready-made one nor an existing file or folder."""
    if arena in NAMED_ARENAS or Path(arena).exists():
        return
    raise UsageError(
        f"no arena '{arena}'; give one of {', '.join(NAMED_ARENAS)}, an arena folder or a mesh file"
    )


def check_arena_folder(arena: str) -> None:
    """Refuse a damaged arena folder before anything is written; what it contains is kept for the run."""
    if arena not in NAMED_ARENAS and Path(arena).is_dir():
        from evolution._src.backends.prepared_arenas import prepare_arena

        prepare_arena(arena)
