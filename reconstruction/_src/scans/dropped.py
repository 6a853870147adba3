"""Which readings of a scan pre-processing left without a point near them, and where."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import find_lengths
from reconstruction._src.scans.cloud import Cloud

NUM_NEIGHBORS = 8
"""Readings around a reading that measure the spacing there."""
REACH = 2.0
"""A reading is lost where no point is nearer than this many spacings: thinning and smoothing lose none."""
MIN_REACH = 0.01
"""Nor is it lost where a point is nearer than this [m]: smoothing moves near readings by more than their spacing."""
NEAREST = 1.0
"""Upper limit of the first interval of ranges [m]; each following one reaches twice as far."""
MIN_TOLD = 0.002
"""Ranges with a smaller share of the readings are not told as the worst: a few readings are soon lost."""
SAMPLE_SIZE = 200_000
"""Larger scans are judged by about so many of their readings."""


@dataclass(frozen=True)
class RangeShare:
    """What was dropped at some ranges.

    Attributes:
        near, far: from which range to which [m].
        num_readings: readings there.
        share: of these, how many were dropped.
    """

    near: float
    far: float
    num_readings: int
    share: float


@dataclass(frozen=True)
class Dropped:
    """The readings that no point is left for.

    Attributes:
        share: of all readings.
        by_range: the same by range from the sensor; empty where its position is unknown.
    """

    share: float
    by_range: tuple[RangeShare, ...]

    def __str__(self) -> str:
        total = sum(part.num_readings for part in self.by_range)
        told = [part for part in self.by_range if part.num_readings >= MIN_TOLD * total]
        worst = max(told, key=lambda part: part.share, default=None)
        if worst is None or worst.share == 0:
            return f"{100 * self.share:.1f} % of the readings"
        return (
            f"{100 * self.share:.1f} % of the readings; at {worst.near:g} to {worst.far:g} m "
            f"{100 * worst.share:.1f} %"
        )


def measure_dropped(readings: Cloud, points: Float[np.ndarray, "N 3"]) -> Dropped:
    """Return the share of readings that have no point near them, in all and by range."""
    is_dropped, chosen = find_dropped(readings.points, points)
    if not len(chosen):
        return Dropped(0.0, ())
    origins = readings.origins
    if origins is None:
        return Dropped(float(is_dropped.mean()), ())
    ranges = find_lengths(readings.points[chosen] - origins[chosen])
    steps = np.ceil(np.log2(np.maximum(ranges / NEAREST, 1.0))).astype(np.int64)
    by_range = []
    for step in np.unique(steps):
        here = is_dropped[steps == step]
        near = NEAREST * 2.0 ** (step - 1) if step else 0.0
        by_range.append(RangeShare(float(near), float(NEAREST * 2.0**step), len(here), float(here.mean())))
    return Dropped(float(is_dropped.mean()), tuple(by_range))


def find_dropped(
    readings: Float[np.ndarray, "M 3"], points: Float[np.ndarray, "N 3"]
) -> tuple[Bool[np.ndarray, " S"], np.ndarray]:
    """Return which of a sample of the readings have no point near them, and the indices of the sample."""
    chosen = np.arange(0, len(readings), max(1, len(readings) // SAMPLE_SIZE))
    num_neighbors = min(NUM_NEIGHBORS, len(readings) - 1)
    if num_neighbors < 1 or not len(points):
        return np.full(len(chosen), not len(points)), chosen
    reach = cKDTree(readings).query(readings[chosen], k=num_neighbors + 1)[0][:, -1]
    spacing = reach * np.sqrt(np.pi / num_neighbors)
    distance = cKDTree(points).query(readings[chosen])[0]
    return distance > np.maximum(REACH * spacing, MIN_REACH), chosen
