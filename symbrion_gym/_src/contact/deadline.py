"""An emergency stop: work ends with the best so far; nothing else depends on the clock."""

from __future__ import annotations

import time


class Deadline:
    """A limit by the clock.

    What is made never depends on how fast or busy a machine is: work is bounded by counts. Only a build that has not
    ended by the deadline is cut short, and says so.
    """

    def __init__(self, limit: float) -> None:
        """Start now."""
        self.limit = limit
        self._start = time.perf_counter()
        self._was_asked_too_late = False

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.perf_counter() - self._start

    def left(self) -> float:
        """Return the time until the limit, not below 0 [s]."""
        return max(self.limit - self.elapsed, 0.0)

    def is_over(self) -> bool:
        """Return whether the limit has passed; whoever asks then ends early."""
        if self.elapsed < self.limit:
            return False
        self._was_asked_too_late = True
        return True

    @property
    def has_cut_short(self) -> bool:
        """Whether some work has ended early."""
        return self._was_asked_too_late


def never() -> bool:
    """Return False: work without a limit."""
    return False
