"""Mixed pixels: readings of beams that met an edge, and lie between two surfaces or near one of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from reconstruction.scans.scan import Array

_SAMPLED = 8
"""One scan in so many is asked for the noise."""
_NOISE, _MOST_NOISE = 0.008, 3.0
"""Noise from which on jumps are higher [m], and how many times."""
_SPACING, _STEP = np.radians(0.5), 0.10
"""Steps of this height [m] between beams this far apart [rad] make a veil; coarser scanners step more."""
_FRAYED, _LEAST = (9, 4), 1e-3
"""Where 4 of 9 beams are in doubt, so are the others: the least doubt [m]."""


def find_mixed_beams(
    ranges: Array,
    *,
    step: float = _STEP,
    jump: float = 0.03,
    jump_per_metre: float = 0.003,
    max_share: float = 0.02,
) -> NDArray[np.bool_]:
    """Find the beams that may have met an edge, `[S, B]`.

    1. *Veils*: ``|r_i - r_(i-1)| > step`` and ``|r_(i+1) - r_i| > step`` with the same sign. The beam hangs
       between two surfaces, or meets one so aslant that its place is uncertain.
    2. *Flanks*: a beam on either side of a jump (`find_jumps`). A mixture of much of one surface and little
       of the other cannot be told from the better of the two by its range: where there is a jump, there is
       doubt, as high as the jumps [m].
    3. *Frays*: every beam that has four of 1 and 2 among the nine around it; an edge along the scan plane.

    The jumps of 2 grow with the noise of the readings (`find_noise`) where that is above 8 mm.

    In a cluttered scene 2 and 3 would cost a tenth of the beams: the most doubtful ones go, to at most
    `max_share` of all valid beams.

    Args:
        ranges: `[S, B]` [m], nan: no return.
        step: see 1 [m]; on a surface met aslant the steps grow with the angle between beams: see `find_step`.
        jump: see `find_jumps` [m].
        jump_per_metre: likewise.
        max_share: see above; 0 leaves 1 alone.
    """
    bridged = _bridge_gaps(ranges)
    difference = np.diff(bridged, axis=1)
    is_valid = np.isfinite(ranges)
    is_mixed = np.zeros(ranges.shape, bool)
    rising, falling = difference > step, difference < -step
    is_mixed[:, 1:-1] = (rising[:, 1:] & rising[:, :-1]) | (falling[:, 1:] & falling[:, :-1])
    scale = float(np.clip(find_noise(ranges) / _NOISE, 1.0, _MOST_NOISE))
    height = np.where(find_jumps(bridged, scale * jump, scale * jump_per_metre), np.abs(difference), 0.0)
    doubt = np.zeros(ranges.shape)
    doubt[:, 1:] += height
    doubt[:, :-1] += height
    window, count = _FRAYED
    around = uniform_filter1d((is_mixed | (doubt > 0)).astype(np.float32), window, axis=1, mode="constant")
    doubt[(around > (count - 0.5) / window) & (doubt == 0)] = _LEAST
    doubt[is_mixed | ~is_valid] = 0.0
    most = int(max_share * np.count_nonzero(is_valid))
    if np.count_nonzero(doubt) > most:
        place = doubt.size - most - 1
        doubt[doubt <= np.partition(doubt, place, axis=None)[place]] = 0.0
    return (is_mixed | (doubt > 0)) & is_valid


def find_step(angles: Array) -> float:
    """Return the step that makes a veil [m]: 10 cm for beams half a degree apart or less, more for coarser ones."""
    spacing = float(np.median(np.abs(np.diff(angles)))) if len(angles) > 1 else _SPACING
    return _STEP * spacing / _SPACING if spacing > 1.01 * _SPACING else _STEP


def find_noise(ranges: Array) -> float:
    """Estimate the noise of readings, the middle of them [m]; 0 where no three beams lie side by side.

    On a plane 1/r hardly bends from beam to beam: ``r^2 (q_(i+1) - 2 q_i + q_(i-1))`` has sqrt(6) times the noise.
    """
    inverse = 1.0 / ranges[::_SAMPLED]
    bend = np.abs(inverse[:, 2:] - 2 * inverse[:, 1:-1] + inverse[:, :-2])
    bend /= inverse[:, 1:-1] ** 2
    bend = bend[np.isfinite(bend)]
    return float(np.median(bend)) / (0.6745 * np.sqrt(6)) if bend.size else 0.0


def find_jumps(ranges: Array, jump: float = 0.03, jump_per_metre: float = 0.004) -> NDArray[np.bool_]:
    """Find where two neighbouring beams lie on no common surface, `[S, B - 1]`.

    On a plane 1/r goes as cos(a - a0), so steps of 1/r change little from beam to beam however aslant it is
    met: beams i and i+1 are parted by a jump where both ``|r_(i+1) - r_i|`` and ``r_i r_(i+1) |s_i - s_j|``,
    ``s_i = 1/r_(i+1) - 1/r_i``, for all but one of the four neighbouring steps j (two on either side), exceed
    ``jump + jump_per_metre sqrt(r_i r_(i+1))``.

    Args:
        ranges: `[S, B]` [m], nan: no return.
        jump: several times the noise of a step [m].
        jump_per_metre: its growth with the range.
    """
    step = np.diff(1.0 / ranges, axis=1)
    num_steps = step.shape[1]
    padded = np.pad(step, ((0, 0), (2, 2)), constant_values=np.nan)
    a, b, c, d = (_distance(step, padded[:, k : k + num_steps]) for k in (0, 1, 3, 4))
    second = np.maximum(np.minimum(a, b), np.minimum(c, d))
    np.minimum(second, np.maximum(a, b), out=second)
    np.minimum(second, np.maximum(c, d), out=second)
    product = ranges[:, 1:] * ranges[:, :-1]
    threshold = jump + jump_per_metre * np.sqrt(product)
    with np.errstate(invalid="ignore"):
        return (second * product > threshold) & (np.abs(np.diff(ranges, axis=1)) > threshold)


def _bridge_gaps(ranges: Array) -> Array:
    """Fill single beams without return by the mean of 1/r beside them: planes stay planes, jumps stay jumps."""
    inverse = 1.0 / ranges
    gap = np.isnan(inverse[:, 1:-1]) & np.isfinite(inverse[:, 2:]) & np.isfinite(inverse[:, :-2])
    bridged = ranges.copy()
    scan, beam = np.nonzero(gap)
    bridged[scan, beam + 1] = 2.0 / (inverse[scan, beam] + inverse[scan, beam + 2])
    return bridged


def _distance(step: Array, other: Array) -> Array:
    """Distance between two steps; infinite where there is none."""
    distance = np.abs(step - other)
    distance[np.isnan(distance)] = np.inf
    return distance
