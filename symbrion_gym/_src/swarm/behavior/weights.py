"""The weights of the behaviors: named numbers with bounds."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import radians
from typing import Any

import numpy as np

from symbrion_gym._src.errors import OptionError


def _weight(default: float, low: float, high: float) -> Any:
    return field(default=default, metadata={"bounds": (low, high)})


@dataclass(frozen=True)
class BehaviorWeights:
    """How robots steer and how long they try; each has bounds in `list_bounds`.

    All are estimates but `locate_speed`, which was fitted to docking trials of real robots
    (`evolution._src.experiments.swarm.docking_trials`).

    Raises:
        OptionError: a weight is out of its bounds.
    """

    # [m/s]; faster robots find each other sooner, and run farther into what they meet
    explore_speed: float = _weight(0.08, 0.02, 0.10)
    # mean time that an exploring robot drives straight before it turns at random [s]
    straight_time: float = _weight(8.0, 2.0, 60.0)
    # rate of turning per angle to the place that is steered for [1/s]
    turn_gain: float = _weight(1.5, 0.3, 4.0)
    turn_speed: float = _weight(0.05, 0.01, 0.10)  # largest difference of a track from the mean of both [m/s]
    avoid_distance: float = _weight(0.10, 0.03, 0.20)  # a reading below it is an obstacle [m]
    avoid_time: float = _weight(2.0, 0.3, 6.0)  # how long a robot that met one turns away [s]
    locate_speed: float = _weight(0.035, 0.01, 0.10)  # on the way to a beacon [m/s]
    # share of the distance to the beacon at which the place on its axis lies that is steered for: at 0
    # straight to the beacon, at 1 first to its axis
    lookahead: float = _weight(0.6, 0.0, 1.0)
    # where driving ends and aligning begins, from dock to dock [m]
    align_distance: float = _weight(0.10, 0.04, 0.25)
    # bearing of the beacon at which the robot goes in [rad]
    align_angle: float = _weight(radians(5), radians(1), radians(20))
    # direction from the beacon's axis above which the robot does not go in but recovers [rad]
    align_offset: float = _weight(radians(20), radians(5), radians(60))
    align_time: float = _weight(6.0, 1.0, 20.0)  # after this without success the robot recovers [s]
    dock_speed: float = _weight(0.025, 0.005, 0.06)  # on the last stretch [m/s]
    dock_time: float = _weight(8.0, 2.0, 20.0)  # after this without a latch the robot recovers [s]
    recover_speed: float = _weight(0.05, 0.01, 0.10)  # of backing off [m/s]
    recover_time: float = _weight(4.0, 0.5, 10.0)  # how long [s]
    lost_time: float = _weight(8.0, 0.3, 15.0)  # a beacon not heard for this long is lost [s]
    # a recruiter waits for a robot that it has accepted for this long [s]
    accept_time: float = _weight(60.0, 10.0, 200.0)
    # distance at which a robot passes an organism on the way to the beacon [m]
    guide_offset: float = _weight(0.35, 0.2, 0.8)
    # an organism that does not grow for this long dissolves [s]
    patience: float = _weight(600.0, 60.0, 900.0)

    def __post_init__(self) -> None:
        for name, (low, high) in list_bounds().items():
            value = getattr(self, name)
            if not (np.all(low <= np.asarray(value)) and np.all(np.asarray(value) <= high)):
                raise OptionError(f"weight {name} must be from {low:.4g} to {high:.4g}, got {value!r}")


def list_bounds() -> dict[str, tuple[float, float]]:
    """Return the lowest and highest value of every weight, by name."""
    return {each.name: each.metadata["bounds"] for each in fields(BehaviorWeights)}
