"""Watches what ends the episodes of N simulations, and calls only the terms for which something may have happened."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from symbrion_gym._src.tasks.state import MEASURES, UPPER_MEASURES, TaskState, check_function
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terms import BASE_FLAGS

_TICK, _WAY = MEASURES.index("tick"), MEASURES.index("way")
_NUM_UPPER = len(UPPER_MEASURES)
_NUMBER_OF = {name: number for number, name in enumerate(MEASURES)}


class Watch:
    """The ends of N episodes. Each term with `limits` is quiet while the measures keep to them; all limits are
    compared at once."""

    def __init__(self, task: Task, state: TaskState, max_ticks: float = np.inf) -> None:
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
        # `[flags, N]` success, diverged, and one for each termination; those of the last tick of each episode
        self.flags = np.zeros((len(BASE_FLAGS) + len(self._terms), num), dtype=bool)
        # `[N]` whether the episode ended by what happened, or was cut off, at the last tick that any ended
        self.terminated, self.truncated = np.zeros((2, num), dtype=bool)
        self._held = np.zeros(num)
        ticks = state.criteria.hold_time / state.dt
        self._hold_ticks = max(1, int(np.ceil(ticks - 1e-9)))  # but for rounding
        self._last_tick = min(round(task.duration / state.dt), max_ticks)
        self._seen = np.zeros((len(MEASURES), num), dtype=bool)
        self._limits = np.zeros(self._seen.shape)
        is_lower = np.arange(len(MEASURES)) >= _NUM_UPPER
        self._is_quiet = np.array(np.broadcast_to(is_lower[:, None], self._seen.shape))
        self._quiet = self._is_quiet.tobytes()
        self._widest = np.where(is_lower, -np.inf, np.inf)[:, None] * np.ones(num)
        self._widest[_TICK] = self._last_tick - 0.5
        self._own: list[dict[int, Any]] = [{} for _ in self._all]
        self._is_always = [getattr(term, "limits", None) is None for term in self._all]
        self._has_always = any(self._is_always)
        self._is_eventful = False

    def begin(self, rows: Sequence[int]) -> None:
        """Start episodes in some simulations whose state has just begun."""
        self.flags[:, rows] = False
        self._held[rows] = 0.0
        self._widest[_WAY] = self._state.note_lead()
        self._set_limits(range(len(self._all)))

    def _set_limits(self, indices: Iterable[int]) -> None:
        """Ask terms for their limits, which may have moved, and find the narrowest of each measure."""
        for index in indices:
            if not self._is_always[index]:
                limits = self._all[index].limits(self._state)
                self._own[index] = {_NUMBER_OF[name]: value for name, value in limits.items()}
        self._limits[...] = self._widest
        for own in self._own:
            for measure, value in own.items():
                narrowest = self._limits[measure]
                (np.minimum if measure < _NUM_UPPER else np.maximum)(narrowest, value, out=narrowest)

    def look(self, active: Bool[np.ndarray, " N"] | None, is_sound: bool) -> bool:
        """Find what happened in a tick; return whether any episode ended."""
        np.greater_equal(self._state.measures, self._limits, out=self._seen)
        is_calm = is_sound and not self._is_eventful
        if is_calm and not self._has_always and self._seen.tobytes() == self._quiet:
            return False
        if self._seen[_WAY].any():
            self._widest[_WAY] = self._state.note_lead()
        is_hit = self._seen != self._is_quiet
        hits = np.flatnonzero(
            is_hit.any(axis=1) if active is None else (is_hit & active).any(axis=1)
        ).tolist()
        called = [
            index
            for index, own in enumerate(self._own)
            if self._is_eventful or self._is_always[index] or not own.keys().isdisjoint(hits)
        ]
        found = [(index, self._terms[index](self._state)) for index in called if index < self._goal_index]
        if is_calm and self._goal_index not in called:
            is_late = _TICK in hits and np.count_nonzero(self._state.tick >= self._last_tick)
            if not is_late and not any(np.count_nonzero(each) for _, each in found):
                self._set_limits(called)
                return False
        active = np.ones(self._state.num, dtype=bool) if active is None else active
        return self._end(active, self._goal_index in called, found, called)

    def _end(
        self,
        active: Bool[np.ndarray, " N"],
        may_arrive: bool,
        found: Sequence[tuple[int, np.ndarray]],
        called: Sequence[int],
    ) -> bool:
        """Find which episodes ended, and how.

        What is measured of an unstable simulation means nothing, but for the time.
        """
        state, flags = self._state, self.flags
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
            np.copyto(flags[index + len(BASE_FLAGS)], each, where=active)
        if may_arrive:
            has_arrived = self._has_arrived(state) & ~failed & active
            self._held = np.where(has_arrived, self._held + 1.0, 0.0)
        success = self._held >= self._hold_ticks
        np.copyto(flags[:2], (success, ~state.is_sound), where=active)
        np.copyto(state.failed, failed, where=active)
        np.copyto(state.success, success, where=active)
        self.terminated = (is_over | success) & active
        self.truncated = is_cut & ~self.terminated & active
        np.copyto(state.ended, self.terminated | self.truncated, where=active)
        self._set_limits(called)
        self._is_eventful = bool((flags.any(axis=0) & active).any() or (self._held > 0.0).any())
        return bool((self.terminated | self.truncated).any())

    @property
    def is_late(self) -> Bool[np.ndarray, " N"]:
        """Whether the time of each episode is up."""
        return self._state.tick >= self._last_tick


class Reasons:
    """Why episodes ended, as numbers of words: the flag of what happened, or "timeout"; 0, "", for those that go on."""

    def __init__(self, task: Task) -> None:
        flags = [*BASE_FLAGS, *(term.name for term in task.terminations)]
        cuts = [term.name for term in task.terminations if term.truncates]
        ordered = [*(name for name in flags if name not in cuts), *cuts]  # what cuts off counts last
        self._order = np.array([flags.index(name) for name in ordered])
        self.words = np.array(["", *ordered, "timeout"])

    def find(self, flags: Bool[Any, "F N"], is_late: Bool[Any, " N"], xp: Any) -> Int[Any, " N"]:
        """Return the number of the word for each episode."""
        ends = xp.concatenate([flags[self._order], is_late[None]])
        return xp.where(ends.any(axis=0), 1 + xp.argmax(ends, axis=0), 0)
