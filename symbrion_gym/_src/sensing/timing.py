"""MuJoCo's own timers: what a step, its collisions and its sensors cost, without a stopwatch in Python.

MuJoCo times its stages itself, in C; reading the timers costs the simulation nothing.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

_STAGES = ("STEP", "POS_COLLISION", "FORWARD", "POSITION", "VELOCITY", "ACTUATION", "CONSTRAINT")


@dataclass
class Timing:
    """What was measured; complete once the context is left."""

    num_steps: int = 0  # physics steps
    physics_us: float = 0.0  # mean duration of a step, collisions and sensors included [µs]
    collision_us: float = 0.0  # time of its collision detection [µs]
    # time of the rest of a step besides position, velocity, actuation and constraint [µs]: the sensors,
    # nearly all of it the rays of infrared units and laser
    raycast_us: float = 0.0


@contextmanager
def timing(data: mujoco.MjData) -> Iterator[Timing]:
    """Time the physics steps made within the context.

    Args:
        data: of the simulation.

    Raises:
        ValueError: the timers do not move.
    """
    before, result = _read(data), Timing()
    yield result
    spent, counts = (_read(data) - before).T
    result.num_steps = int(counts[0])
    if result.num_steps > 0 and spent[0] <= 0.0:
        raise ValueError("MuJoCo's timers do not move; is a time callback (mjcb_time) set?")
    if result.num_steps > 0:
        step, collision, forward, *stages = 1e6 * spent / result.num_steps
        result.physics_us, result.collision_us = step, collision
        result.raycast_us = max(forward - sum(stages), 0.0)


def _read(data: mujoco.MjData) -> Float[np.ndarray, "7 2"]:
    """Return durations [s] and counts of the stages."""
    timers = [data.timer[getattr(mujoco.mjtTimer, f"mjTIMER_{name}")] for name in _STAGES]
    return np.array([(each.duration, each.number) for each in timers], np.float64)
