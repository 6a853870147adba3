"""Patches of ground with one friction each, from friction by place."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.outlines import find_largest_rectangle
from reconstruction._src.knowledge.slip.drags import FrictionReadings

_NORMAL_95 = 1.96  # Half-width of a 95 % interval in standard deviations
_LEAST_SIGMA = 1e-3  # Standard deviations below this are rounding
_PENALTY = 16.0
"""Cost of one more change along the way, in squared standard deviations: 16 takes one for a change of 4
standard deviations, which chance shows once in 16,000 readings."""
_LEAST_READINGS = 2  # Stretches of fewer are left out
_BORDER = 0.06
"""Readings closer to a change are left out: the module, which touches the ground over 65 mm, may have stood on
both sides [m]."""
_SAME = 0.03  # Stretches whose frictions differ by less are one patch ...
_CERTAINTY = 3.0  # ... or by less than so many standard deviations
_REACH = 0.3
"""Ground up to this far from a reading is of its patch [m]; what is farther away is of the largest patch."""
_CELL = 0.05  # Sides of patches are multiples of this [m]
_FEWEST_CELLS = 20
"""Rectangles of fewer cells at the rim of a patch are left out: nobody knows borders to a centimeter."""


class EstimatedPatch(NamedTuple):
    """Ground of one friction."""

    friction: float  # its friction
    half_width: float  # half-width of the 95 % interval
    # lowest x, y, highest x, y [m]; none for the largest patch: the rest
    rectangles: Float[np.ndarray, "R 4"]
    num_readings: int  # number of readings in it


class FrictionEstimate(NamedTuple):
    """What is known of the friction of a ground."""

    patches: tuple[EstimatedPatch, ...]  # the largest first; it is all ground outside of the others
    readings: FrictionReadings  # friction by place
    patch_of: Int[np.ndarray, " D"]  # number of the patch of every reading; -1 on borders


def estimate_friction_patches(readings: FrictionReadings) -> FrictionEstimate | None:
    """Group friction by place into patches of one friction each.

    Along every run, changes are found first; stretches of equal friction, wherever they are, are one patch then. The
    interval of a patch holds the scatter of its readings and the error that they share.
    """
    patch_of = _join(readings, _find_stretches(readings))
    counts = np.bincount(patch_of[patch_of >= 0])
    if not len(counts):
        return None
    order = np.argsort(-counts, kind="stable")
    patch_of = np.where(patch_of >= 0, np.argsort(order)[patch_of], -1)
    cells = _find_cells(readings.places[:, :2], patch_of)
    patches = [
        EstimatedPatch(*_summarize(readings, patch_of == number), cells[number], int(counts[order[number]]))
        for number in range(len(order))
    ]
    return FrictionEstimate(tuple(patches), readings, patch_of)


def _find_stretches(readings: FrictionReadings) -> Int[np.ndarray, " D"]:
    """Return the stretch of every reading; -1 on borders."""
    stretches, next_number = np.full(len(readings.frictions), -1), 0
    for run in np.unique(readings.runs):
        own = np.flatnonzero(readings.runs == run)
        sigma = max(float(np.median(readings.sigmas[own])), _LEAST_SIGMA)
        numbers = find_segments(readings.frictions[own], sigma, _PENALTY)
        parts = [own[numbers == number] for number in range(numbers[-1] + 1)]
        parts = [part for part in parts if len(part) >= _LEAST_READINGS]
        for before, part, after in zip([None, *parts], parts, [*parts[1:], None], strict=False):
            is_inside = np.ones(len(part), dtype=bool)
            for other, theirs, mine in ((before, -1, 0), (after, 0, -1)):
                if other is None:
                    continue
                change = readings.frictions[other].mean() - readings.frictions[part].mean()
                if abs(change) <= _SAME:
                    continue
                middle = (readings.places[other[theirs]] + readings.places[part[mine]]) / 2
                is_inside &= np.linalg.norm(readings.places[part] - middle, axis=1) > _BORDER
            if is_inside.sum() >= _LEAST_READINGS:
                stretches[part[is_inside]] = next_number
                next_number += 1
    return stretches


def find_segments(values: Float[np.ndarray, " D"], sigma: float, penalty: float) -> Int[np.ndarray, " D"]:
    """Return the number of the stretch that each value belongs to, from 0.

    Minimizes the sum of ``((value - mean of its stretch) / sigma)^2 + penalty`` per stretch, exactly, by dynamic
    programming.

    References:
        Jackson et al. (2005), An algorithm for optimal partitioning of data on an interval, IEEE Signal Proc. Letters
        12(2).
    """
    count = len(values)
    scaled = (values - values.mean() if count else values) / sigma
    sums, squares = (np.concatenate([[0.0], np.cumsum(scaled**power)]) for power in (1, 2))
    best, begin = np.zeros(count + 1), np.zeros(count + 1, dtype=np.int64)
    for end in range(1, count + 1):
        starts = np.arange(end)
        rest = squares[end] - squares[:end] - (sums[end] - sums[:end]) ** 2 / (end - starts)
        cost = best[:end] + rest + penalty
        begin[end] = int(np.argmin(cost))
        best[end] = cost[begin[end]]
    cuts, end = [], count
    while end > 0:
        end = int(begin[end])
        cuts.append(end)
    numbers = np.zeros(count, dtype=np.int64)
    numbers[[cut for cut in cuts if 0 < cut < count]] = 1
    return np.cumsum(numbers)


def _join(readings: FrictionReadings, stretches: Int[np.ndarray, " D"]) -> Int[np.ndarray, " D"]:
    """Join stretches of equal friction, the two most alike first."""
    count = int(stretches.max(initial=-1)) + 1
    groups = [[number] for number in range(count)]
    weights = readings.sigmas**-2.0
    weight = [weights[stretches == number].sum() for number in range(count)]
    mean = [(weights * readings.frictions)[stretches == n].sum() / weight[n] for n in range(count)]
    while len(groups) > 1:
        order = np.argsort(mean)
        variance = 1 / np.array(weight)[order]
        spread = _CERTAINTY * np.sqrt(variance[1:] + variance[:-1])
        excess = np.diff(np.array(mean)[order]) - np.maximum(_SAME, spread)
        at = int(np.argmin(excess))
        if excess[at] >= 0.0:
            break
        a, b = int(order[at]), int(order[at + 1])
        mean[a] = (weight[a] * mean[a] + weight[b] * mean[b]) / (weight[a] + weight[b])
        weight[a] += weight[b]
        groups[a] += groups[b]
        del groups[b], mean[b], weight[b]
    joined = np.full(count + 1, -1)
    for number, group in enumerate(groups):
        joined[group] = number
    return joined[stretches]


def _summarize(readings: FrictionReadings, is_own: Bool[np.ndarray, " D"]) -> tuple[float, float]:
    """Return friction and half-width of the 95 % interval of a patch."""
    values, sigmas = readings.frictions[is_own], readings.sigmas[is_own]
    weights = sigmas**-2.0
    friction = float(np.average(values, weights=weights))
    scatter = max(1.0, float(np.sqrt(np.average((values - friction) ** 2 / sigmas**2))))
    shared = float(np.median(readings.shared[is_own]))
    return friction, float(_NORMAL_95 * np.hypot(scatter / np.sqrt(weights.sum()), shared))


def _find_cells(
    places: Float[np.ndarray, "D 2"], patch_of: Int[np.ndarray, " D"]
) -> list[Float[np.ndarray, "R 4"]]:
    """Return the rectangles of every patch: cells that are nearest to one of its readings; none for patch 0."""
    known = patch_of >= 0
    low = np.floor((places[known].min(axis=0) - _REACH) / _CELL).astype(np.int64)
    high = np.ceil((places[known].max(axis=0) + _REACH) / _CELL).astype(np.int64)
    axes = [np.arange(*ends) for ends in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    distance, nearest = cKDTree(places[known]).query((grid + 0.5) * _CELL)
    owner = np.where(distance <= _REACH, patch_of[known][nearest], 0)
    rectangles: list[np.ndarray] = [np.zeros((0, 4))]
    for number in range(1, int(patch_of.max()) + 1):
        corners = np.array(_cover(owner == number), dtype=np.int64).reshape(-1, 4)
        rectangles.append((corners + np.concatenate([low, low])) * _CELL)
    return rectangles


def _cover(is_own: Bool[np.ndarray, "X Y"]) -> list[tuple[int, int, int, int]]:
    """Return rectangles of enough cells that cover cells once each, the largest first."""
    left, found = is_own.copy(), []
    while True:
        x0, y0, x1, y1 = best = find_largest_rectangle(left)
        if (x1 - x0) * (y1 - y0) < _FEWEST_CELLS:
            return found
        left[x0:x1, y0:y1] = False
        found.append(best)
