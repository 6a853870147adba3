"""MuJoCo's own timers: what a step, its collisions and its sensors cost, without a stopwatch in Python.

MuJoCo times its stages itself, in C, in every simulation that has an `MjData` of its own; reading the timers
costs the simulation nothing. What the timers themselves cost is measured by `measure_overhead`.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int
from mujoco.batch import Batch

_TIMER = mujoco.mjtTimer
_STAGES = (
    _TIMER.mjTIMER_STEP,
    _TIMER.mjTIMER_POS_COLLISION,
    _TIMER.mjTIMER_FORWARD,
    _TIMER.mjTIMER_POSITION,
    _TIMER.mjTIMER_VELOCITY,
    _TIMER.mjTIMER_ACTUATION,
    _TIMER.mjTIMER_CONSTRAINT,
)


@dataclass
class Timing:
    """What was measured; complete once the context is left."""

    num_steps: int = 0  # physics steps, of all simulations together
    physics_us: float = 0.0  # mean duration of a step, collisions and sensors included [µs]
    collision_us: float = 0.0  # time of its collision detection [µs]
    # time of the rest of a step besides position, velocity, actuation and constraint [µs]: the sensors,
    # nearly all of it the rays of infrared units and laser
    raycast_us: float = 0.0
    overhead_us: float = float("nan")  # cost of the timers in a step [µs], where it was asked for


@contextmanager
def timing(source: mujoco.MjData | Batch, model: mujoco.MjModel | None = None) -> Iterator[Timing]:
    """Time the physics steps made within the context.

    Args:
        source: a simulation, or a batch made with `persistent=True`, whose simulations are summed up.
        model: the model of a single simulation: measure the cost of the timers too, afterwards, on a copy.

    Raises:
        ValueError: a batch that keeps no timers, or timers that do not move.
    """
    if isinstance(source, Batch) and not source.persistent:
        raise ValueError("this batch keeps no timers; make it with persistent=True")
    before, result = _read(source), Timing()
    yield result
    spent, counts = (after - first for after, first in zip(_read(source), before, strict=True))
    result.num_steps = int(counts[0])
    if result.num_steps > 0 and spent[0] <= 0.0:
        raise ValueError("MuJoCo's timers do not move; is a time callback (mjcb_time) set?")
    if result.num_steps > 0:
        step, collision, forward, *stages = 1e6 * spent / result.num_steps
        result.physics_us, result.collision_us = step, collision
        result.raycast_us = max(forward - sum(stages), 0.0)
    if model is not None:
        result.overhead_us = measure_overhead(model)


def measure_overhead(model: mujoco.MjModel, num_reads: int = 20000) -> float:
    """Return what the timers cost in a step of `model` [µs].

    A step reads the clock twice for each stage that it times; the price of a reading is that of the
    processor's monotonic clock, taken here through the cheapest call that Python has, thus from above.
    """
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    readings = 2 * sum(int(data.timer[stage].number) for stage in range(int(_TIMER.mjNTIMER)))
    clock = time.perf_counter_ns
    prices = []
    for _ in range(5):
        start = clock()
        for _ in range(num_reads):
            clock()
        prices.append((clock() - start) / num_reads)
    return 1e-3 * readings * float(np.median(prices))


def _read(source: mujoco.MjData | Batch) -> tuple[Float[np.ndarray, " 7"], Int[np.ndarray, " 7"]]:
    """Return durations [s] and counts of the stages."""
    simulations = [source]
    if isinstance(source, Batch):
        simulations = [source.get_data(i) for i in range(source.nsim)]
    timers = [[data.timer[stage] for stage in _STAGES] for data in simulations]
    durations = np.array([[timer.duration for timer in row] for row in timers], dtype=np.float64)
    counts = np.array([[timer.number for timer in row] for row in timers], dtype=np.int64)
    return durations.sum(axis=0), counts.sum(axis=0)
