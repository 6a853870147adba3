"""The moving average of neighboring readings (paper, section II-A)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.mixed_pixels import find_jumps
from reconstruction._src.scans.scan import ScanLog


@dataclass(frozen=True)
class SmoothingConfig:
    """How readings are averaged with their neighbors (`smooth_ranges`)."""

    window: int = 5  # number of readings, odd; 1 changes nothing. 5 is the paper's.
    across_jumps: bool = False  # the paper's mean: over jumps and creases, arithmetic
    # height of the lowest edge that ends the window, at range 0 [m]; see `find_jumps`. Several times the
    # noise of a step between two beams (10 to 15 mm).
    jump: float = 0.03
    # its growth with the range, as that of the noise and of the distance between beams
    jump_per_meter: float = 0.004
    # least bend of a surface that ends the window, at range 0 [m]; see `find_creases`. Several times the
    # noise of the bend.
    crease: float = 0.03
    crease_per_meter: float = 0.004  # its growth with the range

    def __post_init__(self) -> None:
        if self.window < 1 or self.window % 2 == 0:
            raise ScanError(f"window must be odd and above 0, got {self.window}")
        for name in ("jump", "jump_per_meter", "crease", "crease_per_meter"):
            if not getattr(self, name) >= 0:
                raise ScanError(f"{name} must not be negative, got {getattr(self, name)}")


def smooth_ranges(
    log: ScanLog,
    window: int | None = None,
    across_jumps: bool | None = None,
    *,
    config: SmoothingConfig | None = None,
) -> ScanLog:
    """Average every reading with its neighbors in the scan: ``r_i <- mean(r_(i-2) .. r_(i+2))`` for a window of 5.

    Differs: the paper averages all readings in the window. Here the window shrinks, on both sides alike (a mean
    over a slanted surface is right only where it is symmetric), until it holds no jump (`find_jumps`), no beam
    without return, and no crease (`find_creases`) except at its ends. And it is the harmonic mean, which is exact on
    planes: ``1/r`` is ``cos(a - a0) / d``.

    Args:
        log: the scans.
        window: replaces `config.window`.
        across_jumps: replaces `config.across_jumps`.
        config: the window, and what ends it.

    Raises:
        ScanError: the window is not odd and above 0.
    """
    config = config or SmoothingConfig()
    if window is not None:
        config = replace(config, window=window)
    if across_jumps is not None:
        config = replace(config, across_jumps=across_jumps)
    values = log.ranges if config.across_jumps else 1.0 / log.ranges
    good = np.isfinite(values)
    half = min(config.window // 2, good.shape[1] - 1)
    filled = np.where(good, values, 0.0)
    if config.across_jumps:
        total, count = _add_all(filled, good, half)
    else:
        total, count = _add_symmetric(log.ranges, filled, good, half, config)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
        smooth = mean if config.across_jumps else 1.0 / mean
    return log.replace(ranges=np.where(good, smooth, np.nan))


def find_creases(
    ranges: Float[np.ndarray, "S B"], crease: float = 0.03, crease_per_meter: float = 0.004
) -> Bool[np.ndarray, "S B"]:
    """Find the beams where two surfaces meet without a jump.

    On a plane 1/r bends little: ``c_i = r_i^2 |q_(i+2) - 2 q_i + q_(i-2)|``, ``q = 1/r``, is mere noise. A crease is
    where c_i exceeds ``crease + crease_per_meter r_i`` and both its neighbors.
    """
    bend = np.zeros(ranges.shape)
    if ranges.shape[1] >= 5:
        inverse = 1.0 / ranges
        bend[:, 2:-2] = np.abs(inverse[:, 4:] - 2 * inverse[:, 2:-2] + inverse[:, :-4]) * ranges[:, 2:-2] ** 2
        np.nan_to_num(bend, copy=False)
    highest = np.pad(bend, ((0, 0), (1, 1)))
    with np.errstate(invalid="ignore"):
        is_bent = bend > crease + crease_per_meter * ranges
    return is_bent & (bend >= highest[:, :-2]) & (bend >= highest[:, 2:])


def _add_all(
    values: Float[np.ndarray, "S B"], good: Bool[np.ndarray, "S B"], half: int
) -> tuple[Float[np.ndarray, "S B"], Int[np.ndarray, "S B"]]:
    """Return sum and number of all readings up to `half` beams away."""
    total, count = values.copy(), good.astype(np.int64)
    for k in range(1, half + 1):
        total[:, :-k] += values[:, k:]
        total[:, k:] += values[:, :-k]
        count[:, :-k] += good[:, k:]
        count[:, k:] += good[:, :-k]
    return total, count


def _add_symmetric(
    ranges: Float[np.ndarray, "S B"],
    values: Float[np.ndarray, "S B"],
    good: Bool[np.ndarray, "S B"],
    half: int,
    config: SmoothingConfig,
) -> tuple[Float[np.ndarray, "S B"], Int[np.ndarray, "S B"]]:
    """Return sum and number of the readings in the widest window of one surface, up to `half` beams to either side."""
    num_beams = good.shape[1]
    linked = good[:, 1:] & good[:, :-1] & ~find_jumps(ranges, config.jump, config.jump_per_meter)
    is_passable = ~find_creases(ranges, config.crease, config.crease_per_meter)
    total, count = values.copy(), good.astype(np.int64)
    reaches = np.ones(good.shape, bool)
    for k in range(1, half + 1):
        if num_beams <= 2 * k:
            break
        inner = slice(k, num_beams - k)
        step = linked[:, : num_beams - 2 * k] & linked[:, 2 * k - 1 :]
        step &= is_passable[:, 1 : num_beams - 2 * k + 1] & is_passable[:, 2 * k - 1 : num_beams - 1]
        wider = np.zeros_like(reaches)
        wider[:, inner] = reaches[:, inner] & step
        reaches = wider
        both = values[:, : num_beams - 2 * k] + values[:, 2 * k :]
        total[:, inner] += np.where(reaches[:, inner], both, 0.0)
        count += 2 * reaches
    return total, count


LEAST_SCANS = 100
"""Logs of fewer scans tell nothing about noise: `UNKNOWN_SLIP` and `UNKNOWN_SHAKE` are taken."""
UNKNOWN_SLIP = 0.01
"""Error of the wheels after one meter where nothing is known [m]: tracks on carpet or gravel; wheels on a hard floor
slip less, and are trusted too little then."""
UNKNOWN_SHAKE = float(np.radians(1.0))  # Sway where nothing is known [rad]
_LAGS = (5, 10, 20, 40)
"""Scans between the poses whose differences are compared: beyond the memory of the sway, and short enough that there
are many."""
_GAUSSIAN = 1.4826  # Standard deviation of a normal distribution in median absolute deviations


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
