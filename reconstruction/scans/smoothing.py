"""The moving average of neighbouring readings (paper, section II-A)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reconstruction.errors import ScanError
from reconstruction.scans.mixed_pixels import find_jumps
from reconstruction.scans.scan import Array, ScanLog


def smooth_ranges(log: ScanLog, window: int = 5, across_jumps: bool = False) -> ScanLog:
    """Average every reading with its neighbours in the scan: ``r_i <- mean(r_(i-2) .. r_(i+2))`` for 5.

    Differs: the paper averages whatever lies in the window. Here the window shrinks, on both sides alike (a mean
    over a slanted surface is right only where it is symmetric), until it holds no jump (`find_jumps`), no beam
    without return, and no crease (`find_creases`) except at its ends. And it is the harmonic mean, which is exact on
    planes: ``1/r`` is ``cos(a - a0) / d``.

    Args:
        log: the scans.
        window: number of readings, odd; 1 changes nothing.
        across_jumps: the paper's mean, over jumps and creases, arithmetic.

    Raises:
        ScanError: the window is not odd and above 0.
    """
    if window < 1 or window % 2 == 0:
        raise ScanError(f"window must be odd and above 0, got {window}")
    values = log.ranges if across_jumps else 1.0 / log.ranges
    good = np.isfinite(values)
    half = min(window // 2, good.shape[1] - 1)
    add = _add_all if across_jumps else _add_symmetric
    total, count = add(log.ranges, np.where(good, values, 0.0), good, half)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
        smooth = mean if across_jumps else 1.0 / mean
    return log.replace(ranges=np.where(good, smooth, np.nan))


def find_creases(ranges: Array, least: float = 0.03, least_per_metre: float = 0.004) -> NDArray[np.bool_]:
    """Find the beams where two surfaces meet without a jump, `[S, B]`.

    On a plane 1/r bends little: ``c_i = r_i^2 |q_(i+2) - 2 q_i + q_(i-2)|``, ``q = 1/r``, is mere noise. A crease is
    where c_i exceeds ``least + least_per_metre r_i`` and both its neighbours.
    """
    bend = np.zeros(ranges.shape)
    if ranges.shape[1] >= 5:
        inverse = 1.0 / ranges
        bend[:, 2:-2] = np.abs(inverse[:, 4:] - 2 * inverse[:, 2:-2] + inverse[:, :-4]) * ranges[:, 2:-2] ** 2
        np.nan_to_num(bend, copy=False)
    highest = np.pad(bend, ((0, 0), (1, 1)))
    with np.errstate(invalid="ignore"):
        is_bent = bend > least + least_per_metre * ranges
    return is_bent & (bend >= highest[:, :-2]) & (bend >= highest[:, 2:])


def _add_all(
    ranges: Array, values: Array, good: NDArray[np.bool_], half: int
) -> tuple[Array, NDArray[np.int64]]:
    """Sum and number of all readings up to `half` beams away."""
    total, count = values.copy(), good.astype(np.int64)
    for k in range(1, half + 1):
        total[:, :-k] += values[:, k:]
        total[:, k:] += values[:, :-k]
        count[:, :-k] += good[:, k:]
        count[:, k:] += good[:, :-k]
    return total, count


def _add_symmetric(
    ranges: Array, values: Array, good: NDArray[np.bool_], half: int
) -> tuple[Array, NDArray[np.int64]]:
    """Sum and number of the readings in the widest window of one surface, up to `half` beams to either side."""
    num_beams = good.shape[1]
    linked = good[:, 1:] & good[:, :-1] & ~find_jumps(ranges)
    is_passable = ~find_creases(ranges)
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
