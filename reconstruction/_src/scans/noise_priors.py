"""How much a robot sways and slips: stated by who knows the robot, else estimated from its log."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.errors import ScanError

LEAST_SCANS = 100
"""Logs of fewer scans tell nothing about noise: `UNKNOWN_SLIP` and `UNKNOWN_SHAKE` are taken."""
UNKNOWN_SLIP = 0.01
"""Error of the wheels after one meter where nothing is known [m]: tracks on carpet or gravel; wheels on a hard floor
slip less, and are trusted too little then."""
UNKNOWN_SHAKE = float(np.radians(1.0))
"""Sway where nothing is known [rad]."""
_LAGS = (5, 10, 20, 40)
"""Scans between the poses whose differences are compared: beyond the memory of the sway, and short enough that there
are many."""
_GAUSSIAN = 1.4826
"""Standard deviation of a normal distribution in median absolute deviations."""


@dataclass(frozen=True)
class NoisePriors:
    """What is known of a robot's noise before it drives; what is None is estimated from the log.

    Attributes:
        slip: standard deviation of the wheels' error after one meter [m] (and [rad]); it grows with the square root of
            the way.
        shake: standard deviation of roll and pitch as the robot drives [rad].
        range_noise: standard deviation of the scanner's readings [m]; None for the tolerance of the configuration.

    Raises:
        ScanError: a number is negative or not finite.
    """

    slip: float | None = None
    shake: float | None = None
    range_noise: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not 0 <= value < np.inf:
                raise ScanError(
                    f"NoisePriors: {field.name} must not be negative, got {value}; None estimates it"
                )


def estimate_shake(declination: Float[np.ndarray, " S"]) -> float:
    """Return the standard deviation of the sway [rad], from the declination of the floor in every scan.

    The floor shows the roll of a robot; its pitch is taken as alike. Scans in which no floor was seen have 0.
    """
    seen = declination[declination != 0.0]
    if len(seen) < LEAST_SCANS:
        return UNKNOWN_SHAKE
    return float(_GAUSSIAN * np.median(np.abs(seen - np.median(seen))))


def estimate_slip(error: Float[np.ndarray, " S"], way: Float[np.ndarray, " S"]) -> tuple[float, float]:
    """Return slip [m] and the standard deviation of what does not grow with the way [m], from a track and its wheels.

    The mean squared difference of the error over k scans (a variogram) is ``2 sway^2 + slip^2 way_k``: a line through
    it has the slip as its slope, and sway and matching, which do not add up, as its offset.
    """
    if len(error) < LEAST_SCANS:
        return UNKNOWN_SLIP, float("nan")
    square = [float(np.mean((error[k:] - error[:-k]) ** 2)) for k in _LAGS]
    mean_way = [float(np.mean(way[k:] - way[:-k])) for k in _LAGS]
    if np.ptp(mean_way) == 0.0:
        return UNKNOWN_SLIP, float("nan")
    slope, offset = np.polyfit(mean_way, square, 1)
    return float(np.sqrt(max(slope, 0.0))), float(np.sqrt(max(offset, 0.0) / 2))
