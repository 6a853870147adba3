"""The user's cache folder: compiled networks and decomposed arenas survive there between processes."""

import functools
import logging
import os
import stat
import tempfile
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "SYMBRION_CACHE"

logger = logging.getLogger(__name__)


def find_cache_folder(name: str) -> Path:
    """Return a writable cache folder, created if it is missing.

    `SYMBRION_CACHE` names another place than the platform's own. Where neither can be written (a read-only home), it is
    a folder in the system's temporary directory, if only this user can write to it.
    """
    wanted = Path(os.environ.get(CACHE_VARIABLE) or platformdirs.user_cache_path("symbrion-gym")) / name
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        if os.access(wanted, os.W_OK):
            return wanted
    except OSError:
        pass
    fallback = _find_temporary_folder() / name
    fallback.mkdir(exist_ok=True, mode=0o700)
    return fallback


def _find_temporary_folder() -> Path:
    """Return the user's own folder in the shared temporary one, or a new private one where others could write to it."""
    user = os.getuid() if hasattr(os, "getuid") else "user"  # Windows: the temporary folder is the user's own
    folder = Path(tempfile.gettempdir()) / f"symbrion-gym-{user}"
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        if not _is_private(folder):
            return _make_private_folder(folder)
    return folder


def _is_private(folder: Path) -> bool:
    """Return whether a folder is the user's own, no link, and nobody else may write into it."""
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        return False
    return not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o022)


@functools.cache
def _make_private_folder(refused: Path) -> Path:
    """Return a new folder for this process, and log why."""
    folder = Path(tempfile.mkdtemp(prefix="symbrion-gym-"))
    logger.warning(
        "%s is not this user's alone, nothing is read from it; what is made is kept in %s. Remove it, or "
        "set %s to a folder of yours",
        refused,
        folder,
        CACHE_VARIABLE,
    )
    return folder
