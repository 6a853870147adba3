"""Slip readings by formula: a module of 0.8 kg that drags on flat ground or a slope, exact."""

import numpy as np

from reconstruction._src.scans.slip_readings import SlipReadings

TICK, MASS, SPEED, GRAVITY = 0.02, 0.8, 0.12, 9.81


def make_slip(
    friction,
    slope: float = 0.0,
    seconds: float = 20.0,
    offset: float = 0.24,
    bias: float = 0.0,
    noise: float = 0.0,
    both_ways: bool = True,
) -> SlipReadings:
    """Drive along x, up a slope [rad]; friction is a function of x; `bias` of the pull of the dock [N]."""
    rng = np.random.default_rng(0)
    times = np.arange(0.0, seconds, TICK)
    number, phase = np.divmod(times, 1.0)
    sign = np.where(number % 2 == 0, -1.0, 1.0) if both_ways else np.ones(len(times))
    change = np.where(phase < 0.5, 0.0, offset * sign)
    way = SPEED * times
    x, z = way * np.cos(slope), way * np.sin(slope)
    load = MASS * GRAVITY * np.cos(slope)
    pull = np.sign(change) * np.vectorize(friction)(x) * load
    specific = np.stack(
        [np.full(len(times), GRAVITY * np.sin(slope)), 0 * x, GRAVITY * np.cos(slope) + 0 * x], 1
    )
    forces = MASS * specific - np.stack([pull, 0 * x, np.full(len(times), load)], axis=1)
    forces[:, 0] += bias
    forces += noise * rng.standard_normal(forces.shape)
    return SlipReadings(
        times,
        np.zeros(len(times), dtype=int),
        np.stack([x, 0 * x, z], axis=1),
        np.zeros(len(times)),
        np.full(len(times), slope),
        SPEED + change,
        specific,
        forces,
        MASS,
    )
