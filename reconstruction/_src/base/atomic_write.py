"""The one way in which this project writes files: to a temporary name, then renamed, so that none is ever half."""

import errno
import os
import re
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_LONGEST_STEM = 40  # Characters of a name that its temporary file keeps: the whole must not exceed 255 bytes
_WINDOWS_WAIT = 2.0
"""How long a rename is tried again on Windows while another process has the file open [s]: a reader of a history
or a virus scanner needs milliseconds. Other systems let a file be replaced that is open."""
_LEFTOVER = re.compile(r"\.(?P<stem>.+)\.[0-9a-f]{12}\.part(?P<suffix>(?:\.[^.]*)?)")


@contextmanager
def write_atomically(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path in the same folder to write to; it replaces `path` at the end.

    A reader of `path`, at any time and after any kill, finds the old file or the new one. After an error `path` is as
    it was, and nothing is left next to it. A link is replaced, not what it leads to, which in a folder of somebody
    else is anything. A file that was there keeps its mode.
    """
    path = Path(os.path.realpath(Path(path).parent)) / Path(path).name
    _refuse_irreplaceable(path)
    temporary = path.with_name(f".{path.stem[:_LONGEST_STEM]}.{secrets.token_hex(6)}.part{path.suffix}")
    try:
        yield temporary
        if path.exists() and not path.is_symlink():
            shutil.copymode(path, temporary)
        _flush(temporary)
        _replace(temporary, path)
    except OSError as error:
        if error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_file(path: Path, content: bytes) -> None:
    """Write a file atomically, in a folder that need not be there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as beside:
        beside.write_bytes(content)


def find_leftovers(folder: str | os.PathLike[str]) -> dict[Path, str]:
    """Return the temporary files in a folder, of killed writers and of present ones: path -> name they were for.

    Of a name longer than 40 characters the first 40 are known.
    """
    entries = Path(folder).iterdir() if Path(folder).is_dir() else ()
    matches = {path: _LEFTOVER.fullmatch(path.name) for path in entries}
    return {path: f"{match['stem']}{match['suffix']}" for path, match in matches.items() if match}


def _refuse_irreplaceable(path: Path) -> None:
    """Refuse what a rename would replace though writing would not: a folder, a device, a write-protected file."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "Not a regular file", str(path))
    if path.exists() and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def _flush(path: Path) -> None:
    """Write to the disk what a rename is about to publish."""
    # Windows flushes only what is open for writing.
    descriptor = os.open(path, os.O_RDWR if sys.platform == "win32" else os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _replace(source: Path, target: Path) -> None:
    """Rename a file over another one; on Windows wait while another process has that open."""
    deadline = time.monotonic() + (_WINDOWS_WAIT if sys.platform == "win32" else 0.0)
    while True:
        try:
            os.replace(source, target)
            return
        except PermissionError:
            if time.monotonic() >= deadline:
                raise
            time.sleep(0.01)
