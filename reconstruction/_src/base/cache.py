"""The user's cache folder: compiled networks and decomposed arenas survive there between processes."""

import functools
import logging
import os
import tempfile
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "SYMBRION_CACHE"

logger = logging.getLogger(__name__)


def find_cache_folder(name: str) -> Path:
    """Return a writable cache folder, created if it is missing.

    `SYMBRION_CACHE` names another place than the platform's own. Where that cannot be written (a read-only home), it is
    a new folder of this process alone in the system's temporary directory.
    """
    root = Path(os.environ.get(CACHE_VARIABLE) or platformdirs.user_cache_path("symbrion-gym"))
    try:
        (root / name).mkdir(parents=True, exist_ok=True)
        if os.access(root / name, os.W_OK):
            return root / name
    except OSError:
        pass
    folder = _make_private_folder(root) / name
    folder.mkdir(exist_ok=True)
    return folder


@functools.cache
def _make_private_folder(wanted: Path) -> Path:
    """Return a new folder of this process, and log why."""
    folder = Path(tempfile.mkdtemp(prefix="symbrion-gym-"))
    text = "%s cannot be written; what is made is kept in %s. Set %s to a folder of yours"
    logger.warning(text, wanted, folder, CACHE_VARIABLE)
    return folder
