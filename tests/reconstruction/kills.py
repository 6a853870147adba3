"""A kill at each moment of some writing, without a process to kill, so that every moment has its turn."""

import itertools
import os
import sys
import threading
from collections.abc import Callable, Iterator

_CHANGES = {
    "os.rename",
    "os.remove",
    "os.mkdir",
    "os.rmdir",
    "os.link",
    "os.symlink",
    "os.truncate",
    "os.chmod",
}
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


class Killed(BaseException):
    """The process is no more."""


class _Victim:
    """Counts the calls of one thread that change a file system; from some number on none is carried out."""

    def __init__(self, moment: int) -> None:
        self.moment, self.thread = moment, threading.get_ident()
        self.is_dead = False
        self.written: str | bytes | os.PathLike | None = None

    def meet(self, event: str, arguments: tuple) -> None:
        opens = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & _WRITING)
        if not (opens or event in _CHANGES) or threading.get_ident() != self.thread:
            return
        self.is_dead = self.is_dead or self.moment == 0
        if self.is_dead:
            raise Killed
        self.moment -= 1
        self.written = arguments[0] if opens else None


_victim: _Victim | None = None


def _hook(event: str, arguments: tuple) -> None:
    if _victim is not None:
        _victim.meet(event, arguments)


sys.addaudithook(_hook)


def kill_at_each_moment(prepare: Callable[[], object], work: Callable[[], object]) -> Iterator[str]:
    """Do some work, killed before its first change of the file system; yield; and again, killed before the second.

    A file that was being written when the kill came has all of its content the one time, and half of it the other.
    What `finally` and `except` would mend is not mended: after the kill no change is carried out any more.

    Yields:
        Which moment it was. The last time the work was not killed at all.
    """
    global _victim
    for moment, is_half in ((moment, is_half) for moment in itertools.count() for is_half in (False, True)):
        prepare()
        _victim = victim = _Victim(moment)
        try:
            work()
        except Killed:
            pass
        finally:
            _victim = None
        if is_half:
            if victim.written is None or not os.path.isfile(victim.written):
                continue
            os.truncate(victim.written, os.path.getsize(victim.written) // 2)
        yield f"moment {moment}"
        if not victim.is_dead:
            return
