"""What a body needs of the ground: its size, and the slopes and steps that it climbs."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Organism

STEP_LIMITS = ((1, 0.010), (5, 0.020), (8, 0.040))
"""(modules in a row, step that they climb [m]): Scouts on sphere tracks at 0.10 m/s, hinges straight, friction 0.7.
Measured in MuJoCo, straight on: 1 module climbs 10 mm and not 12, 2 modules 18 and not 20, 3 modules 15 and not 18, 5
modules 20 and not 25, 8 modules 40, the highest that was tried. 2 modules that also turn get stuck on natural terrain
with steps of 15 mm (6 of 16 drives, 2 of 16 with 10)."""
SLOPE_LIMIT = float(np.deg2rad(15.0))
"""Slope that Scouts climb [rad], measured likewise on planes: 1 module climbs 20 degrees and tips over at 25; on bumps
of natural terrain it tips over at 17. 2 modules climb 30 degrees straight up; on natural terrain with slopes of up to
20 they slide off in hollows (4 of 8 drives, 0 of 8 on the same ground with up to 15, 1 of 8 on another)."""
ROLL_LIMIT = float(np.deg2rad(15.0))
"""Side slope on which Scouts stay upright [rad]. Measured in MuJoCo across planes, at rest, driving and turning: 1, 2,
4 and 8 modules stand at 25 degrees and tip over at 30; bumps of natural terrain add up to 10 on one side."""
_FRICTION_SHARE = 0.85
"""Of the angle of friction that is climbed: tracks that turn or cross a seam slip sooner."""


@dataclass(frozen=True)
class Footprint:
    """What a body needs of the ground. The defaults are those of one Scout.

    Attributes:
        length: extent along its way when its hinges are straight [m].
        width: extent across [m].
        height: free height that it needs above the ground [m]: a Scout's 0.105, and 0.02 to rock on tracks.
        max_slope: steepest ground that it climbs [rad]; see `SLOPE_LIMIT`.
        max_step: highest step that it climbs [m]; see `STEP_LIMITS`.
        max_roll: steepest ground that it crosses sideways [rad]; see `ROLL_LIMIT`.
        radius: distance of its middle from walls and rims that it keeps [m]; None for half of its diagonal, so that
            it can turn on the spot everywhere.

    Raises:
        OptionError: a number is out of range.
    """

    length: float = 0.105
    width: float = 0.105
    height: float = 0.125
    max_slope: float = SLOPE_LIMIT
    max_step: float = STEP_LIMITS[0][1]
    max_roll: float = ROLL_LIMIT
    radius: float | None = None

    def __post_init__(self) -> None:
        check_positive(self, ("length", "width", "height", "max_slope", "max_roll"), OptionError)
        check_not_negative(
            self, ("max_step",) if self.radius is None else ("max_step", "radius"), OptionError
        )
        for name in ("max_slope", "max_roll"):
            if not getattr(self, name) < np.pi / 2:
                raise OptionError(f"Footprint: {name} must be below pi/2 rad, got {getattr(self, name)!r}")

    @property
    def reach(self) -> float:
        """Distance that the middle keeps from walls and rims [m]: `radius`, or half of the diagonal."""
        return float(np.hypot(self.length, self.width)) / 2 if self.radius is None else self.radius

    @classmethod
    def of(cls, body: Organism | Footprint | None, friction: float | None = None) -> Footprint:
        """Return the footprint of a body; None is one Scout.

        Args:
            body: an organism, whose hinges are straight; a footprint is returned as it is.
            friction: sliding friction of its tracks; None for that of its constants.

        Raises:
            OptionError: the body is of another kind.
        """
        if isinstance(body, Footprint):
            return body
        body = Organism(1) if body is None else body
        if not isinstance(body, Organism):
            raise OptionError(f"body must be an Organism or a Footprint, got {body!r}")
        places = np.array([(pose.x, pose.y) for pose in body.compute_poses()])
        extent = np.ptp(places, axis=0) + body.scout.size[:2]
        in_a_row = round(float(extent[0] - body.scout.size[0]) / body.scout.pitch) + 1
        hold = float(compute_hold(body.scout.friction if friction is None else friction))
        return cls(
            length=round(float(extent[0]), 9),
            width=round(float(extent[1]), 9),
            height=body.scout.size[2] + body.scout.track_radius,
            max_slope=min(SLOPE_LIMIT, hold),
            max_step=STEP_LIMITS[bisect_right([row for row, _ in STEP_LIMITS], in_a_row) - 1][1],
        )


def compute_hold(friction: float | Float[np.ndarray, " P"]) -> Float[np.ndarray, "*P"]:
    """Return the steepest slope on which tracks hold [rad]."""
    return np.asarray(_FRICTION_SHARE * np.arctan(friction))
