"""A time limit that long work asks about; other work on the machine does not change what comes out."""

from __future__ import annotations

import os
import time


class TimeBudget:
    """A time limit.

    Choices that shape a result go by processor time, that of child processes too: other work on the machine does
    not change it. The clock only guards: work that waits longer than the limit ends.
    """

    def __init__(self, limit: float, *, slack: float = 0.5, long_wait: float = 0.25) -> None:
        """Start now.

        Args:
            limit: [s].
            slack: share of what is left that the clock may use beyond a share of the limit: an idle machine, whose
                clock runs a little ahead of its processors, is never ended by the clock.
            long_wait: work that has waited for this share of the limit may have been cut short by others.
        """
        self._limit, self._slack, self._long_wait = limit, slack, long_wait
        self._start, self._spent = time.perf_counter(), _read_processor_time()
        self._was_exceeded_by_clock = False

    @property
    def elapsed(self) -> float:
        """Time since the start, by the clock [s]."""
        return time.perf_counter() - self._start

    @property
    def spent(self) -> float:
        """Processor time since the start [s]."""
        return _read_processor_time() - self._spent

    def left(self) -> float:
        """Return the time until the limit, by the clock, not below 0 [s]."""
        return max(self._limit - self.elapsed, 0.0)

    def is_exceeded(self, share: float = 1.0) -> bool:
        """Return whether this share of the limit is used up: as processor time, or somewhat more by the clock."""
        if self.spent >= share * self._limit:
            return True
        is_exceeded_by_clock = self.elapsed >= (share + self._slack * (1.0 - share)) * self._limit
        # At the end the clock has no slack: work that fills the limit has not waited.
        self._was_exceeded_by_clock |= is_exceeded_by_clock and share < 1.0
        return is_exceeded_by_clock

    @property
    def is_disturbed(self) -> bool:
        """Whether other work on the machine may have changed what came out."""
        return self._was_exceeded_by_clock or self.elapsed - self.spent > self._long_wait * self._limit


def never() -> bool:
    """Return False: work without a limit."""
    return False


def _read_processor_time() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
