"""A time limit that long work looks at, and a busy machine does not change what comes out."""

from __future__ import annotations

import os
import time

_PATIENCE = 0.5
"""Share of the limit that may pass on the clock, beyond what was asked for, before work is late."""
_LONG_WAIT = 0.25
"""Who has waited for this share of the limit may have been cut short by others."""


class Watch:
    """A time limit.

    Choices that shape a result go by processor time, that of child processes too: other work on the machine does
    not change it. The clock only guards: work that waits longer than the limit ends.
    """

    def __init__(self, limit: float) -> None:
        """Start now; `limit` in seconds."""
        self._limit = limit
        self._start, self._spent = time.perf_counter(), _read_processor_time()
        self._was_late_by_clock = False

    @property
    def elapsed(self) -> float:
        """Time since the start, by the clock [s]."""
        return time.perf_counter() - self._start

    @property
    def spent(self) -> float:
        """Processor time since the start [s]."""
        return _read_processor_time() - self._spent

    def left(self) -> float:
        """Time until the limit, by the clock, not below 0 [s]."""
        return max(self._limit - self.elapsed, 0.0)

    def is_late(self, share: float = 1.0) -> bool:
        """Whether this share of the limit is used up: as processor time, or somewhat more of it by the clock."""
        if self.spent >= share * self._limit:
            return True
        is_late_by_clock = self.elapsed >= (share + _PATIENCE * (1.0 - share)) * self._limit
        # At the end the clock has no patience: work that fills the limit has not waited.
        self._was_late_by_clock |= is_late_by_clock and share < 1.0
        return is_late_by_clock

    @property
    def was_kept_waiting(self) -> bool:
        """Whether other work on the machine may have changed what came out."""
        return self._was_late_by_clock or self.elapsed - self.spent > _LONG_WAIT * self._limit


def _read_processor_time() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
