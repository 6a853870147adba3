"""MuJoCo's own timers: what a step, its collisions and its sensors cost, without a stopwatch in Python.

MuJoCo times its stages itself, in C, in every simulation that has an `MjData` of its own; reading the timers
costs the simulation nothing.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.batch import Batch

_STAGES = ("STEP", "POS_COLLISION", "FORWARD", "POSITION", "VELOCITY", "ACTUATION", "CONSTRAINT")


@dataclass
class Timing:
    """What was measured; complete once the context is left."""

    num_steps: int = 0  # physics steps, of all simulations together
    physics_us: float = 0.0  # mean duration of a step, collisions and sensors included [µs]
    collision_us: float = 0.0  # time of its collision detection [µs]
    # time of the rest of a step besides position, velocity, actuation and constraint [µs]: the sensors,
    # nearly all of it the rays of infrared units and laser
    raycast_us: float = 0.0


@contextmanager
def timing(source: mujoco.MjData | Batch) -> Iterator[Timing]:
    """Time the physics steps made within the context.

    Args:
        source: a simulation, or a batch made with `persistent=True`, whose simulations are summed up.

    Raises:
        ValueError: a batch that keeps no timers, or timers that do not move.
    """
    if isinstance(source, Batch) and not source.persistent:
        raise ValueError("this batch keeps no timers; make it with persistent=True")
    before, result = _read(source), Timing()
    yield result
    spent, counts = (_read(source) - before).T
    result.num_steps = int(counts[0])
    if result.num_steps > 0 and spent[0] <= 0.0:
        raise ValueError("MuJoCo's timers do not move; is a time callback (mjcb_time) set?")
    if result.num_steps > 0:
        step, collision, forward, *stages = 1e6 * spent / result.num_steps
        result.physics_us, result.collision_us = step, collision
        result.raycast_us = max(forward - sum(stages), 0.0)


def _read(source: mujoco.MjData | Batch) -> Float[np.ndarray, "7 2"]:
    """Return durations [s] and counts of the stages."""
    is_batch = isinstance(source, Batch)
    simulations = [source.get_data(i) for i in range(source.nsim)] if is_batch else [source]
    stages = [getattr(mujoco.mjtTimer, f"mjTIMER_{name}") for name in _STAGES]
    rows = [[data.timer[stage] for stage in stages] for data in simulations]
    return np.array([[(each.duration, each.number) for each in row] for row in rows], np.float64).sum(axis=0)
