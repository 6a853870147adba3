"""When a body is stuck: known by hand, alone and in company."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from symbrion_gym._src.tasks.scene import HostArrays
from symbrion_gym._src.tasks.terminations import Stuck


class State(HostArrays, SimpleNamespace):
    """A state of what is given alone."""


def make_state(num: int) -> Any:
    """Make what the termination reads, at the start."""
    memory: dict[str, np.ndarray] = {}

    def remember(name: str, initial: Any) -> np.ndarray:
        value = initial(state) if callable(initial) else np.full(num, initial)
        return memory.setdefault(name, value)

    state = State(
        num=num,
        dt=0.5,
        memory=memory,
        progress=np.zeros(num),
        start_progress=np.zeros(num),
        tick=np.zeros(num),
    )
    state.remember = remember
    return state


def test_each_body_is_stuck_by_its_own_clock():
    state, stuck, found = make_state(3), Stuck(after=2.0, progress=0.1), []
    for moving, creeping in zip(np.arange(1, 9) * 0.2, np.arange(1, 9) * 0.03, strict=True):
        state.tick += 1.0
        state.progress[:] = moving, creeping, 0.0
        found.append(stuck(state).tolist())
    assert [each[0] for each in found] == [False] * 8
    assert [each[1] for each in found] == [False] * 8, "0.12 m at tick 4, 0.24 m at tick 8"
    assert [each[2] for each in found] == [False] * 3 + [True] * 5


def test_limits_follow_those_that_moved_on():
    state, stuck = make_state(2), Stuck(after=2.0, progress=0.1)
    state.tick += 3.0
    state.progress[:] = 0.5, 0.05
    assert not stuck(state).any()
    limits = stuck.limits(state)
    np.testing.assert_array_equal(limits["progress"], [0.6, 0.1])
    np.testing.assert_array_equal(limits["tick"], [6.5, 3.5])
