"""The limits of a success, and of what ends an episode."""

from __future__ import annotations

from dataclasses import dataclass

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import ScoutConfig

_EDGE = ScoutConfig.size[2]
"""Height of the module to which the defaults belong [m]."""


@dataclass(frozen=True)
class SuccessCriteria:
    """Limits of a success, and of what ends an episode.

    Wider limits admit what a person would not call a crossing; `symbrion_gym._src.tasks.audit` finds such cases.

    Attributes:
        hold_time: time for which the organism must stay where it should be [s]: one that flies past or tips back does
            not count.
        upright: smallest z component of the up axis of an upright module: leaning by 60 degrees.
        rolled_over: below this z component of its up axis a module has rolled over; below 0, so that one on its
            side on the way may still right itself.
        ground_band: height of a module's center above the ground that counts as standing on it [m]: half a module's
            height is 0.0525, one stacked on another is above 0.1.
        speed_slack: distance that an organism may be ahead of the path of its tracks, for falling forwards [m].
        fall_lead: how far it may be ahead besides before it arrives, per meter by which the mean height of its modules
            is below that of the highest: 1 is what pays for sliding at a friction of 1, more than tracks have.
        corner: half the edge of the cube in a module that must be beyond the far edge however it is turned [m].
        touch_band: a module this close to the floor of the pit touches it [m].
        max_rate: a coordinate faster than this [m/s or rad/s] means that the simulation has diverged; nothing
            in an arena is.

    Raises:
        OptionError: a number is out of range.
    """

    hold_time: float = 0.3
    upright: float = 0.5
    rolled_over: float = -0.3
    ground_band: tuple[float, float] = (0.02, 0.075)
    speed_slack: float = 0.05
    fall_lead: float = 1.0
    corner: float = 0.05
    touch_band: float = 0.01
    max_rate: float = 50.0

    def __post_init__(self) -> None:
        check_not_negative(
            self, ("hold_time", "speed_slack", "fall_lead", "corner", "touch_band"), OptionError
        )
        check_positive(self, ("max_rate",), OptionError)
        for name in ("upright", "rolled_over"):
            if not -1.0 <= getattr(self, name) <= 1.0:
                raise OptionError(f"SuccessCriteria: {name} must lie in [-1, 1], got {getattr(self, name)!r}")
        low, high = self.ground_band
        if not low < high:
            raise OptionError(f"SuccessCriteria: ground_band must be (low, high), got {self.ground_band!r}")

    @classmethod
    def of(cls, scout: ScoutConfig) -> SuccessCriteria:
        """Return the limits for modules of another size: lengths grow with the height of a module."""
        scale = scout.size[2] / _EDGE
        low, high = cls.ground_band
        return cls(
            ground_band=(low * scale, high * scale),
            speed_slack=cls.speed_slack * scale,
            corner=cls.corner * scale,
            touch_band=cls.touch_band * scale,
        )
