"""The output folder of a command that writes many files: it belongs to the command, or nothing in it changes."""

import os
from collections.abc import Iterable
from pathlib import Path

from evolution._src.errors import RunError


def refuse_foreign_files(folder: Path, marker: str, names: Iterable[str]) -> None:
    """Refuse a folder in which a command would overwrite files that it did not write."""
    links = [name for name in (marker, *names) if (folder / name).is_symlink()]
    if links:
        raise RunError(f"{folder / links[0]} is a link to elsewhere; name another folder, or move the link")
    if (folder / marker).is_file():
        return
    existing = [name for name in (marker, *names) if os.path.lexists(folder / name)]
    if existing:
        raise RunError(
            f"{folder} contains {', '.join(existing)}, which would be overwritten, but no {marker} to show that this "
            "command wrote them; name another folder, or move them"
        )
