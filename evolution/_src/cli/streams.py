"""Standard output and error in all states: closed, a pipe without reader, an encoding without our characters."""

import errno
import os
import sys
from typing import IO


def prepare_streams() -> None:
    """Make both streams writable: characters that an encoding lacks are escaped, closed streams discard output."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def flush_streams() -> OSError | None:
    """Write buffered output, so that nothing fails when the interpreter ends."""
    problem = None
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            discard_output(stream)
            problem = None if is_unread(error) else error
    return problem


def is_unread(error: OSError) -> bool:
    """Return whether writing failed because the reader has closed the pipe, which is no failure of the command."""
    return isinstance(error, BrokenPipeError) or (sys.platform == "win32" and error.errno == errno.EINVAL)


def discard_output(stream: IO[str]) -> None:
    """Discard the output of a stream from now on, including what is buffered."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
