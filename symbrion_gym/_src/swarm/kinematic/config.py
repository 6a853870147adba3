"""What a kinematic robot can drive on, and how it moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.traversability.footprint import STEP_LIMITS

_QUARTER_TURN = 90.0


@dataclass(frozen=True)
class KinematicConfig:
    """Limits and errors of kinematic motion.

    Attributes:
        max_slope: steepest ground under the tracks [deg]. One Scout climbs 20 in MuJoCo and tips over at 25
            (`SLOPE_LIMIT`).
        max_step: highest step up or down at the rim of the chassis [m]. One Scout climbs 10 mm in MuJoCo
            (`STEP_LIMITS`); what is higher, or a pit, stops it.
        max_unknown: largest share of the ground below a robot that may be unknown: scans have small holes. More is the
            end of the surface.
        ceiling: surface above this height is not there [m]: the ceiling of a scanned room; None if there is none. A
            robot drives on the highest surface below it.
        slip: standard deviation of the speed of each track, as a share of it, in every decision (estimate). Odometry
            does not notice it.
        grip: overlap of two robots that is none [m]: rounding.

    Raises:
        OptionError: a value is out of range.
    """

    max_slope: float = 20.0
    max_step: float = STEP_LIMITS[0][1]
    max_unknown: float = 0.25
    ceiling: float | None = None
    slip: float = 0.03
    grip: float = 1e-6

    def __post_init__(self) -> None:
        check_positive(self, ("max_slope", "max_step", "grip"), OptionError)
        check_not_negative(self, ("max_unknown", "slip"), OptionError)
        if not self.max_slope < _QUARTER_TURN:
            raise OptionError(f"KinematicConfig.max_slope must be below 90 degrees, got {self.max_slope!r}")
        if not self.max_unknown < 1.0:
            raise OptionError(f"KinematicConfig.max_unknown must be below 1, got {self.max_unknown!r}")
        if self.ceiling is not None and not np.isfinite(self.ceiling):
            raise OptionError(f"KinematicConfig.ceiling must be a height [m] or None, got {self.ceiling!r}")
