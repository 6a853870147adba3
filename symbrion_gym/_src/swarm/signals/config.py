"""How infrared beacons and messages spread."""

from __future__ import annotations

from dataclasses import dataclass, fields

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError


@dataclass(frozen=True)
class SignalConfig:
    """Constants of the infrared units. A reading is in counts of the robots' converters, ambient light taken off.

    [F] is a fit of ours to the 82 passes of a robot in front of a Scout's front beacon, 1 cm apart, in symbrion-morph
    (`data/data_set10`, `data_set11`), beyond 15 cm: reading = gain (share of the lobe) cos^4 (1 m / distance)^falloff.
    It leaves 1.1 counts of standard deviation at readings of 3 to 8, and 2.7 at 8 to 20. There both robots always
    looked along parallel lines, so that how the lobe divides into that of the sender and of the receiver is an
    estimate [E].

    Attributes:
        gain: reading of a unit at 1 m that looks at a beacon that looks at it [F].
        falloff: exponent of the distance [F].
        lobe: exponent of the cosine of the angle off the beacon's axis, for its narrow part [F].
        side_share: what the beacon sends to all sides before it, as a share of that along its axis [F].
        reception: exponent of the cosine of the angle off the axis of the receiving unit [E].
        saturation: largest reading [F: 275 is the largest there].
        ambient: reading without a beacon [F].
        noise: standard deviation of a reading [F].
        relative_noise: likewise, as a share of the reading [E]; 0.16-0.21 is left by the fit, which includes its error.
        message_threshold: weakest sum of both units of a side with which a message is read [counts] [E].
        message_loss: probability that a message is lost on its way [E].
        capture: how many times as strong as all others together a message must be to be read; else they collide [E].

    Raises:
        OptionError: a value is out of range.
    """

    gain: float = 5.9
    falloff: float = 1.7
    lobe: float = 66.0
    side_share: float = 0.18
    reception: float = 4.0
    saturation: float = 275.0
    ambient: float = 0.5
    noise: float = 0.5
    relative_noise: float = 0.05
    message_threshold: float = 1.5
    message_loss: float = 0.02
    capture: float = 2.0

    def __post_init__(self) -> None:
        positive = ("gain", "falloff", "saturation", "message_threshold", "capture")
        check_positive(self, positive, OptionError)
        check_not_negative(self, [f.name for f in fields(self) if f.name not in positive], OptionError)
        for name in ("side_share", "message_loss"):
            if getattr(self, name) > 1.0:
                raise OptionError(f"SignalConfig.{name} must be at most 1, got {getattr(self, name)!r}")
        if self.capture < 1.0:
            raise OptionError(f"SignalConfig.capture must be at least 1, got {self.capture!r}")
