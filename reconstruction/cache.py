"""The user's cache folder: compiled networks and decomposed arenas survive there between processes."""

import os
import tempfile
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "SYMBRION_CACHE"


def find_cache_folder(name: str) -> Path:
    """Return a writable cache folder, made if need be.

    `SYMBRION_CACHE` names another place than the platform's own. Where neither can be written
    (a read-only home), a folder in the system's temporary directory serves.

    Args:
        name: the kind of things kept, one folder each.
    """
    wanted = Path(os.environ.get(CACHE_VARIABLE) or platformdirs.user_cache_path("symbrion-gym")) / name
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        if os.access(wanted, os.W_OK):
            return wanted
    except OSError:
        pass
    fallback = Path(tempfile.gettempdir()) / f"symbrion-gym-{os.getuid()}" / name
    fallback.mkdir(parents=True, exist_ok=True, mode=0o700)
    return fallback
