"""What is kept of an episode beside its reward: for descriptors, figures and questions of one's own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from reconstruction._src.base.range_checks import check_counts
from symbrion_gym._src.errors import TaskError

if TYPE_CHECKING:
    from symbrion_gym._src.tasks.state import TaskState


@runtime_checkable
class Recorder(Protocol):
    """Keeps something of every episode. It is a value without memory: what it keeps is in `state.memory`."""

    def record(self, state: TaskState, active: Bool[np.ndarray, " N"]) -> None:
        """Look at the state after a tick, and at the start."""
        ...

    def read(self, state: TaskState, row: int) -> dict[str, Any]:
        """Return what was kept of the present episode of a simulation, by name."""
        ...


@dataclass(frozen=True)
class FinalPose:
    """Keep where the modules are at the end: `final_position` `[n, 3]` [m], `final_rotation` `[n, 3, 3]`."""

    def record(self, state: TaskState, active: Bool[np.ndarray, " N"]) -> None:
        """Keep the pose, as the physics goes on to the next episode."""
        state.remember("final_position", lambda state: state.position)[active] = state.position[active]
        state.remember("final_rotation", lambda state: state.rotation)[active] = state.rotation[active]

    def read(self, state: TaskState, row: int) -> dict[str, Any]:
        """Return the pose."""
        position, rotation = state.memory["final_position"][row], state.memory["final_rotation"][row]
        return {"final_position": position.copy(), "final_rotation": rotation.reshape(-1, 3, 3).copy()}


@dataclass(frozen=True)
class Extremes:
    """Keep the extremes over an episode: `lowest` and `highest` `[3]`, corners of the box of all modules' centers [m],
    `most_tilted`, least z of an up axis, and `most_bent`, the fastest hinge [rad/s]."""

    def record(self, state: TaskState, active: Bool[np.ndarray, " N"]) -> None:
        """Widen the extremes."""
        low = state.remember("extreme_low", np.full(3, np.inf))
        high = state.remember("extreme_high", np.full(3, -np.inf))
        up = state.remember("extreme_up", 1.0)
        rate = state.remember("extreme_rate", 0.0)
        low[active] = np.minimum(low, state.position.min(axis=1))[active]
        high[active] = np.maximum(high, state.position.max(axis=1))[active]
        up[active] = np.minimum(up, state.least_up)[active]
        rate[active] = np.maximum(rate, np.abs(state.hinge_rate).max(axis=1, initial=0.0))[active]

    def read(self, state: TaskState, row: int) -> dict[str, Any]:
        """Return the extremes."""
        memory = state.memory
        return {
            "lowest": memory["extreme_low"][row].copy(),
            "highest": memory["extreme_high"][row].copy(),
            "most_tilted": float(memory["extreme_up"][row]),
            "fastest_hinge": float(memory["extreme_rate"][row]),
        }


@dataclass(frozen=True)
class Trajectory:
    """Keep the modules' centers every few ticks: `trajectory` `[T, n, 3]` [m], the start first.

    Raises:
        TaskError: a number is no whole number above 0, or `most` is odd or below 2.
    """

    every: int = 25  # ticks between two of them
    most: int = 256  # as many are kept at most; then every second one is dropped, and the interval is doubled

    def __post_init__(self) -> None:
        check_counts(self, ("every", "most"), TaskError)
        if self.most % 2:
            raise TaskError(f"most must be an even number, got {self.most}")

    def record(self, state: TaskState, active: Bool[np.ndarray, " N"]) -> None:
        """Keep the centers where it is time."""
        kept = state.remember("trajectory", np.zeros((self.most, state.position.shape[1], 3)))
        count = state.remember("trajectory_count", 0)
        every = state.remember("trajectory_every", self.every)
        for row in np.flatnonzero(active & (state.tick % every == 0)):
            if count[row] == self.most:
                kept[row, : self.most // 2] = kept[row, ::2]
                count[row], every[row] = self.most // 2, 2 * every[row]
                if state.tick[row] % every[row]:
                    continue
            kept[row, count[row]] = state.position[row]
            count[row] += 1

    def read(self, state: TaskState, row: int) -> dict[str, Any]:
        """Return the centers and the time between two of them [s]."""
        count = int(state.memory["trajectory_count"][row])
        interval = float(state.memory["trajectory_every"][row]) * state.dt
        return {"trajectory": state.memory["trajectory"][row, :count].copy(), "trajectory_interval": interval}


@dataclass(frozen=True)
class GroundContacts:
    """Keep for how long each module was on the ground: `ground_share` `[n]`, shares of the episode's ticks.

    A module is on the ground when its center is no higher above it than the task's criteria allow.
    """

    every: int = 10  # ticks between two looks, as looking for the ground takes time

    def record(self, state: TaskState, active: Bool[np.ndarray, " N"]) -> None:
        """Count the modules on the ground where it is time."""
        touched = state.remember("contact_touched", np.zeros(state.position.shape[1]))
        looks = state.remember("contact_looks", 0.0)
        rows = np.flatnonzero(active & (state.tick % self.every == 0))
        if len(rows):
            touched[rows] += state.compute_height(rows) < state.criteria.ground_band[1]
            looks[rows] += 1.0

    def read(self, state: TaskState, row: int) -> dict[str, Any]:
        """Return the shares."""
        looks = max(float(state.memory["contact_looks"][row]), 1.0)
        return {"ground_share": state.memory["contact_touched"][row] / looks}


@dataclass(frozen=True)
class Descriptor:
    """Keep what a function of one's own returns at the end of each episode."""

    name: str  # name of the value
    # state -> `[N, ...]`; called in every tick, so it should be quick
    function: Callable[[TaskState], np.ndarray]

    def record(self, state: TaskState, active: Bool[np.ndarray, " N"]) -> None:
        """Keep the present value."""
        value = np.asarray(self.function(state))
        kept = state.remember(f"descriptor_{self.name}", np.zeros(value.shape[1:], dtype=value.dtype))
        kept[active] = value[active]

    def read(self, state: TaskState, row: int) -> dict[str, Any]:
        """Return the last value."""
        return {self.name: state.memory[f"descriptor_{self.name}"][row].copy()}


def check_recorders(recorders: Sequence[Recorder]) -> tuple[Recorder, ...]:
    """Return recorders as a tuple."""
    for each in recorders:
        if not isinstance(each, Recorder):
            raise TaskError(f"a recorder has record(state, active) and read(state, row), got {each!r}")
    return tuple(recorders)
