"""The noise of a Scout's sensors."""

from __future__ import annotations

from dataclasses import dataclass, fields

from reconstruction._src.base.range_checks import check_not_negative
from symbrion_gym._src.errors import OptionError


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviation of each part of an observation at noise level 1; the parts not listed have none.

    All are estimates for the real robot: none was measured on it.

    Attributes:
        hinge_angle: [rad].
        hinge_rate: [rad/s].
        pitch: [rad].
        roll: [rad].
        acceleration: [m/s²].
        ir: standard deviation of a distance [m].
        contact: standard deviation of a force [N].
        odometry: [m]; the paper's robot was localized within 1 cm.
        track_odometry: standard deviation of each reading [m]; slip comes from the physics.
        laser: standard deviation of a distance [m].

    Raises:
        OptionError: a number is negative.
    """

    hinge_angle: float = 0.005
    hinge_rate: float = 0.05
    pitch: float = 0.01
    roll: float = 0.01
    acceleration: float = 0.3
    ir: float = 0.003
    contact: float = 0.5
    odometry: float = 0.01
    track_odometry: float = 0.01
    laser: float = 0.006

    def __post_init__(self) -> None:
        check_not_negative(self, [each.name for each in fields(self)], OptionError)
