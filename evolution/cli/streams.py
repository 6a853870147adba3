"""Standard output and error as they may be: closed, a pipe that nobody reads, of an encoding that lacks our letters."""

import errno
import os
import sys
from typing import IO


def prepare_streams() -> None:
    """Make both streams writable: letters that their encoding lacks are escaped, closed ones lead nowhere."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def flush_streams() -> OSError | None:
    """Write what is still buffered, so that nothing is left to fail when the interpreter ends.

    Returns:
        What went wrong, a full disk say; a reader who has gone is nothing wrong.
    """
    problem = None
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            discard_output(stream)
            problem = None if is_unread(error) else error
    return problem


def is_unread(error: OSError) -> bool:
    """Return whether writing failed as nobody reads the pipe any more, which is no failure of the command."""
    return isinstance(error, BrokenPipeError) or (sys.platform == "win32" and error.errno == errno.EINVAL)


def discard_output(stream: IO[str]) -> None:
    """Lead a stream, what is buffered included, to nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
