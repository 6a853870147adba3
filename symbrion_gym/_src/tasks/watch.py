"""Watches what ends the episodes of N simulations, and calls only the terms for which something may have happened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from symbrion_gym._src.tasks.checked_terms import check_function
from symbrion_gym._src.tasks.state import MEASURES, UPPER_MEASURES, TaskState
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terms import BASE_FLAGS

_TICK, _WAY = MEASURES.index("tick"), MEASURES.index("way")
_NUMBER_OF = {name: number for number, name in enumerate(MEASURES)}
_MOST_KEPT = 128  # What is called is kept for this many combinations of limits that were reached
_find_any = np.logical_or.reduce


class Watch:
    """The ends of N episodes.

    Each term with `limits` is quiet while the measures keep to them. All limits are compared at once.

    Args:
        task: terms to watch.
        state: state of the simulations.

    Attributes:
        flags: `[flags, N]` success, diverged, and one for each termination; those of the last tick of each episode.
        terminated: `[N]` whether the episode ended by what happened, at the last tick that any ended.
        truncated: `[N]` whether it was cut off, likewise.
    """

    def __init__(self, task: Task, state: TaskState) -> None:
        num = state.num
        self._state = state
        self._terms = [
            check_function(f"termination {term.name!r}", term.function) for term in task.terminations
        ]
        self._has_arrived = check_function(
            f"has_arrived of {type(task.goal).__name__}", task.goal.has_arrived
        )
        self._all: list[Any] = [*(term.function for term in task.terminations), task.goal]
        self._goal_index = len(self._terms)
        self._kinds = [(term.is_failure, term.truncates) for term in task.terminations]
        self.flags = np.zeros((len(BASE_FLAGS) + len(self._terms), num), dtype=bool)
        self.terminated, self.truncated = np.zeros((2, num), dtype=bool)
        self._held = np.zeros(num)
        self._hold_ticks = max(
            1, int(np.ceil(state.criteria.hold_time / state.dt - 1e-9))
        )  # but for rounding
        self._last_tick = round(task.duration / state.dt)
        self._limits = np.zeros((len(MEASURES), num))
        self._seen = np.zeros(self._limits.shape, dtype=bool)
        is_lower = np.arange(len(MEASURES)) >= len(UPPER_MEASURES)
        self._is_quiet = np.array(np.broadcast_to(is_lower[:, None], self._limits.shape))
        self._quiet = self._is_quiet.tobytes()
        self._widest = np.where(is_lower, -np.inf, np.inf)[:, None] * np.ones(num)
        self._widest[_TICK] = self._last_tick - 0.5
        self._own: list[dict[int, np.ndarray | float]] = [{} for _ in self._all]
        self._called_for: dict[bytes, tuple[tuple[int, ...], bool]] = {}
        self._is_always = [getattr(term, "limits", None) is None for term in self._all]
        self._has_always = any(self._is_always)
        self._is_eventful = False

    def begin(self, rows: Sequence[int]) -> None:
        """Start episodes in some simulations whose state has just begun."""
        self.flags[:, rows] = False
        self._held[rows] = 0.0
        before = [own.keys() for own in self._own]
        for index in range(len(self._all)):
            self._read_limits(index)
        if before != [own.keys() for own in self._own]:
            self._called_for.clear()
        self._widest[_WAY] = self._state.note_lead()
        for measure in range(len(MEASURES)):
            self._join_limits(measure)

    def _read_limits(self, index: int) -> None:
        """Ask a term for its limits."""
        if not self._is_always[index]:
            limits = self._all[index].limits(self._state)
            self._own[index] = {_NUMBER_OF[name]: value for name, value in limits.items()}

    def _join_limits(self, measure: int) -> None:
        """Find the narrowest limit of a measure."""
        narrowest = self._limits[measure]
        given = [own[measure] for own in self._own if measure in own]
        is_watched = measure in (_TICK, _WAY)
        narrowest[...] = given.pop() if given and not is_watched else self._widest[measure]
        for each in given:
            (np.maximum if measure >= len(UPPER_MEASURES) else np.minimum)(narrowest, each, out=narrowest)

    def _refresh(self, called: Sequence[int]) -> None:
        """Ask terms that have just been called for their limits, which may have moved."""
        for index in called:
            before = self._own[index].keys()
            self._read_limits(index)
            measures = self._own[index].keys()
            if before != measures:
                self._called_for.clear()
                measures = before | measures
            for measure in measures:
                self._join_limits(measure)

    def look(self, active: Bool[np.ndarray, " N"] | None, is_sound: bool) -> bool:
        """Find what happened in a tick; return whether any episode ended."""
        np.greater_equal(self._state.measures, self._limits, out=self._seen)
        seen = self._seen.tobytes()
        is_quiet = is_sound and seen == self._quiet
        if is_quiet and not self._is_eventful and not self._has_always:
            return False
        if self._seen[_WAY].any():
            self._widest[_WAY] = self._state.note_lead()
            self._join_limits(_WAY)
        called, is_late = self._find_called(active, seen)
        found = [(index, self._terms[index](self._state)) for index in called if index < self._goal_index]
        if is_sound and not self._is_eventful and self._goal_index not in called:
            is_late = is_late and np.count_nonzero(self._state.tick >= self._last_tick)
            if not is_late and not any(np.count_nonzero(each) for _, each in found):
                self._refresh(called)
                return False
        return self._judge(np.ones(self._state.num, dtype=bool) if active is None else active, called, found)

    def _judge(
        self, active: Bool[np.ndarray, " N"], called: Sequence[int], found: Sequence[tuple[int, np.ndarray]]
    ) -> bool:
        """Find which episodes ended, and how."""
        state, flags = self._state, self.flags
        failed, is_over, is_cut = self._join_ends(found, active)
        success = self._hold(~failed & active, self._goal_index in called)
        for row, each in ((0, success), (1, ~state.is_sound)):
            np.copyto(flags[row], each, where=active)
        np.copyto(state.failed, failed, where=active)
        np.copyto(state.success, success, where=active)
        self.terminated = (is_over | success) & active
        self.truncated = is_cut & ~self.terminated & active
        self._refresh(called)
        self._is_eventful = bool((flags.any(axis=0) & active).any() or (self._held > 0.0).any())
        return bool((self.terminated | self.truncated).any())

    def _find_called(self, active: Bool[np.ndarray, " N"] | None, seen: bytes) -> tuple[Sequence[int], bool]:
        """Return the terms for which something may have happened, and whether a limit of the time is reached."""
        if self._is_eventful:
            return range(len(self._all)), True
        if active is None and seen in self._called_for:
            return self._called_for[seen]
        hit = self._seen != self._is_quiet
        hits = np.flatnonzero(_find_any(hit if active is None else hit & active, 1)).tolist()
        called = tuple(
            index
            for index, own in enumerate(self._own)
            if self._is_always[index] or not own.keys().isdisjoint(hits)
        )
        if active is None and len(self._called_for) < _MOST_KEPT:
            self._called_for[seen] = called, _TICK in hits
        return called, _TICK in hits

    def _join_ends(
        self, found: Sequence[tuple[int, np.ndarray]], active: Bool[np.ndarray, " N"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what failed, what is over and what is cut off.

        What is measured of an unstable simulation means nothing, but for the time.
        """
        state = self._state
        failed = ~state.is_sound
        is_over, is_cut = failed.copy(), state.tick >= self._last_tick
        for index, each in found:
            is_failure, truncates = self._kinds[index]
            if truncates:
                is_cut |= each
            else:
                each = each & state.is_sound
                is_over |= each
            if is_failure:
                failed |= each
            np.copyto(self.flags[index + len(BASE_FLAGS)], each, where=active)
        return failed, is_over, is_cut

    def _hold(self, is_possible: Bool[np.ndarray, " N"], is_called: bool) -> Bool[np.ndarray, " N"]:
        """Count for how many ticks each body has arrived; return whether that is long enough."""
        if is_called:
            has_arrived = self._has_arrived(self._state) & is_possible
            np.copyto(self._held, np.where(has_arrived, self._held + 1.0, 0.0))
        return self._held >= self._hold_ticks
