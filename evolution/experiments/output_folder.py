"""The folder of a command that makes many files: it is the command's own, or it is left alone."""

import os
from collections.abc import Iterable
from pathlib import Path

from evolution.errors import RunError


def refuse_foreign(folder: Path, mark: str, names: Iterable[str]) -> None:
    """Refuse a folder in which a command would write over what it did not write.

    Args:
        folder: where the command writes; need not exist.
        mark: the file that the command writes there first of all; where it is, the rest is the command's, too.
        names: files and folders that the command makes.

    Raises:
        RunError: there is something of one of these names, and no mark; or one of them is a link, behind which what
            is written would go elsewhere.
    """
    links = [name for name in (mark, *names) if (folder / name).is_symlink()]
    if links:
        raise RunError(f"{folder / links[0]} is a link to elsewhere; name another folder, or move the link")
    if (folder / mark).is_file():
        return
    taken = [name for name in (mark, *names) if os.path.lexists(folder / name)]
    if taken:
        raise RunError(
            f"{folder} holds {', '.join(taken)}, which would be written over, and no {mark} that says they come from "
            "here; name another folder, or move them"
        )
