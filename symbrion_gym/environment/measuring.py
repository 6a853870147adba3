"""Measures of many simulations at once, equal to those of `Judge.measure` to the bit."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from symbrion_gym.environment.judge import LARGEST_SPEED, Judge, Measures
from symbrion_gym.environment.world import Physics

FEWEST = 3
"""Fewer simulations than this are measured faster one by one."""
_NOTHING = Measures(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


class Measured(NamedTuple):
    """What is measured of a simulation at a tick.

    Attributes:
        measures: of its body.
        power: sum over the hinges of the absolute power [W].
    """

    measures: Measures
    power: float


def measure(
    physics: Physics,
    rows: Sequence[int],
    judges: Sequence[Judge],
    servos: slice | np.ndarray,
    dofs: slice | np.ndarray,
) -> list[Measured]:
    """Measure some simulations.

    Args:
        physics: of all simulations.
        rows: which of them.
        judges: of all simulations.
        servos: ids of the hinges' actuators.
        dofs: addresses of the hinges in qvel.
    """
    if len(rows) < FEWEST or not all(judge.is_plain for judge in judges):
        return [
            Measured(judges[row].measure(physics, row), _find_power(physics, row, servos, dofs))
            for row in rows
        ]
    part = slice(None) if len(rows) == len(physics.qvel) else rows
    rates, places, up = physics.qvel[part], physics.position[part], physics.rotation[part, :, 8]
    along, across = places[:, :, 0], places[:, :, 1]
    finish = np.array([[judges[row].finish] for row in rows])
    share = judges[rows[0]].share
    table = np.empty((len(rows), 9))
    table[:, 0] = along[:, 0]
    table[:, 1] = _add_up(along) * share
    np.minimum.reduce(along, axis=1, out=table[:, 2])
    table[:, 3] = _add_up(np.minimum(along, finish)) * share
    np.maximum(np.maximum.reduce(across, axis=1), -np.minimum.reduce(across, axis=1), out=table[:, 4])
    np.minimum.reduce(places[:, :, 2], axis=1, out=table[:, 5])
    np.minimum.reduce(up, axis=1, out=table[:, 6])
    table[:, 7] = np.maximum.reduce(np.abs(rates), axis=1) < LARGEST_SPEED
    table[:, 8] = _add_up(np.abs(physics.actuator_force[part, servos] * rates[:, dofs]))
    return [
        Measured(Measures._make((*numbers[:7], True)) if numbers[7] else _NOTHING, numbers[8])
        for numbers in table.tolist()
    ]


def _add_up(values: np.ndarray) -> np.ndarray:
    """Return sums over the last axis, added one after the other whatever the shape."""
    return np.add.accumulate(values, axis=1)[:, -1] if values.shape[1] else np.zeros(len(values))


def _find_power(physics: Physics, row: int, servos: slice | np.ndarray, dofs: slice | np.ndarray) -> float:
    torques = physics.actuator_force[row, servos].tolist()
    rates = physics.qvel[row, dofs].tolist()
    return reduce(add, [abs(torque * rate) for torque, rate in zip(torques, rates, strict=True)], 0.0)
