"""Watches what ends the episodes of N simulations, and calls only the terms for which something may have happened."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from symbrion_gym.tasks.state import LOWER_MEASURES, MEASURES, UPPER_MEASURES, TaskState
from symbrion_gym.tasks.task import Task
from symbrion_gym.tasks.terms import BASE_FLAGS

_TICK = MEASURES.index("tick")


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
        self._state, self._task = state, task
        self._terms = [term.function for term in task.terminations]
        self._all = [*self._terms, task.goal]
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
        self._own: list[dict[int, np.ndarray]] = [{} for _ in self._all]
        self._watched = [frozenset[int]() for _ in self._all]
        self._is_always = [not hasattr(term, "limits") for term in self._all]
        self._has_always = any(self._is_always)
        self._is_eventful = False

    def begin(self, rows: Sequence[int]) -> None:
        """Start episodes in some simulations whose state has just begun."""
        self.flags[:, rows] = False
        self._held[rows] = 0.0
        for index in range(len(self._all)):
            self._read_limits(index)
        for measure in range(len(MEASURES)):
            self._join_limits(measure)

    def _read_limits(self, index: int) -> None:
        """Ask a term for its limits."""
        limits = getattr(self._all[index], "limits", None)
        if limits is not None:
            found = {MEASURES.index(name): np.asarray(value) for name, value in limits(self._state).items()}
            self._own[index], self._watched[index] = found, frozenset(found)

    def _join_limits(self, measure: int) -> None:
        """Find the narrowest limit of a measure."""
        is_lower = MEASURES[measure] in LOWER_MEASURES
        joined = self._limits[measure]
        joined[:] = self._last_tick - 0.5 if measure == _TICK else -np.inf if is_lower else np.inf
        join = np.maximum if is_lower else np.minimum
        for own in self._own:
            if measure in own:
                join(joined, own[measure], out=joined)

    def look(self, active: Bool[np.ndarray, " N"] | None, is_sound: bool) -> bool:
        """Find what happened in a tick; return whether any episode ended.

        Args:
            active: whether each simulation was stepped; None for all.
            is_sound: whether all simulations are certainly numerically stable.
        """
        np.greater_equal(self._state.measures, self._limits, out=self._seen)
        is_quiet = is_sound and self._seen.tobytes() == self._quiet
        if is_quiet and not self._is_eventful and not self._has_always:
            return False
        with np.errstate(all="ignore"):
            return self._judge(active)

    def _judge(self, active: Bool[np.ndarray, " N"] | None) -> bool:
        state, flags = self._state, self.flags
        active = np.ones(state.num, dtype=bool) if active is None else active
        called = self._find_called(active)
        ends = self._call_terms([index for index in called if index < len(self._terms)], active)
        failed, is_over, is_cut = ends
        success = self._hold(~failed & active, self._goal_index in called)
        for row, found in ((0, success), (1, ~state.is_sound)):
            np.copyto(flags[row], found, where=active)
        np.copyto(state.failed, failed, where=active)
        np.copyto(state.success, success, where=active)
        self.terminated = (is_over | success) & active
        self.truncated = is_cut & ~self.terminated & active
        for index in called:
            self._read_limits(index)
        for measure in frozenset().union(*(self._watched[index] for index in called)):
            self._join_limits(measure)
        self._is_eventful = bool((flags.any(axis=0) & active).any() or (self._held > 0.0).any())
        return bool((self.terminated | self.truncated).any())

    def _find_called(self, active: Bool[np.ndarray, " N"]) -> list[int]:
        """Return the terms for which something may have happened."""
        if self._is_eventful:
            return list(range(len(self._all)))
        hit = ((self._seen != self._is_quiet) & active).any(axis=1).nonzero()[0].tolist()
        return [
            index
            for index, watched in enumerate(self._watched)
            if self._is_always[index] or not watched.isdisjoint(hit)
        ]

    def _call_terms(self, called: Sequence[int], active: Bool[np.ndarray, " N"]) -> tuple[np.ndarray, ...]:
        """Call terminations; return what failed, what is over and what is cut off.

        What is measured of an unstable simulation means nothing, but for the time.
        """
        state = self._state
        failed = ~state.is_sound
        is_over, is_cut = failed.copy(), state.tick >= self._last_tick
        for index in called:
            found, (is_failure, truncates) = self._terms[index](state), self._kinds[index]
            if truncates:
                is_cut |= found
            else:
                found = found & state.is_sound
                is_over |= found
            if is_failure:
                failed |= found
            np.copyto(self.flags[index + len(BASE_FLAGS)], found, where=active)
        return failed, is_over, is_cut

    def _hold(self, is_possible: Bool[np.ndarray, " N"], is_called: bool) -> Bool[np.ndarray, " N"]:
        """Count for how many ticks each body has arrived; return whether that is long enough."""
        if is_called:
            has_arrived = self._task.goal.has_arrived(self._state) & is_possible
            np.copyto(self._held, np.where(has_arrived, self._held + 1.0, 0.0))
        return self._held >= self._hold_ticks
