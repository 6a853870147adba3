<<<<<<< HEAD
"""Readings that pre-processing dropped, and how far from the scanner they were."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple
=======
"""Which readings of a scan pre-processing left without a point near them, and where."""

from dataclasses import dataclass
>>>>>>> surface

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

<<<<<<< HEAD
from reconstruction.errors import ScanError
from reconstruction.scans.cloud import Cloud

_SPACING_SAMPLE = 2000
"""Points of which the spacing is measured."""


@dataclass(frozen=True)
class DroppedConfig:
    """When a reading counts as dropped.

    Attributes:
        reach: no point that was kept is within this distance [m]; 10 cm is more than smoothing and leveling move a
            point ...
        spacings: ... or within this many times the median distance of the kept points from each other, where they
            were thinned to more than that.

    Raises:
        ScanError: a number is not above 0.
    """

    reach: float = 0.10
    spacings: float = 2.0

    def __post_init__(self) -> None:
        for name in ("reach", "spacings"):
            if not getattr(self, name) > 0:
                raise ScanError(f"{name} is {getattr(self, name)}; more than 0 is needed")


class RangeBin(NamedTuple):
    """Readings between two distances from the scanner.

    Attributes:
        low: shortest distance [m].
        high: longest distance [m].
        num_readings: how many there are.
        dropped: share of them that was dropped.
    """

    low: float
    high: float
    num_readings: int
    dropped: float


def find_dropped(
    readings: Float[np.ndarray, "N 3"], kept: Float[np.ndarray, "M 3"], config: DroppedConfig | None = None
) -> Bool[np.ndarray, " N"]:
    """Return which readings have no kept point near.

    Args:
        readings: all readings [m].
        kept: points after pre-processing, in the same frame [m].
        config: what is near.
    """
    config = config or DroppedConfig()
    if not len(kept) or not len(readings):
        return np.ones(len(readings), dtype=bool)
    tree = cKDTree(kept)
    sample = kept[:: max(len(kept) // _SPACING_SAMPLE, 1)]
    spacing = float(np.median(tree.query(sample, k=2)[0][:, 1])) if len(kept) > 1 else 0.0
    reach = max(config.reach, config.spacings * spacing)
    return ~np.isfinite(tree.query(readings, distance_upper_bound=reach)[0])


def bin_dropped(cloud: Cloud, is_dropped: Bool[np.ndarray, " N"]) -> list[RangeBin]:
    """Return the share of dropped readings by their distance from the scanner, in steps of a factor of two.

    Args:
        cloud: all readings, with the viewpoint of each; without these there are no bins.
        is_dropped: as `find_dropped` returned it.
    """
    if cloud.origins is None or not cloud.num_points:
        return []
    ranges = np.linalg.norm(cloud.points - cloud.origins, axis=1)
    power = np.floor(np.log2(np.maximum(ranges, 1.0))).astype(int)
    bins = []
    for each in np.unique(power):
        is_in = power == each
        low = 0.0 if each == 0 else 2.0**each
        bins.append(RangeBin(low, 2.0 ** (each + 1), int(is_in.sum()), float(is_dropped[is_in].mean())))
    return bins
=======
from reconstruction.geometry.rows import find_lengths
from reconstruction.scans.cloud import Cloud

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
    """Return the share of readings that have no point near them, in all and by range.

    Args:
        readings: all of the scan.
        points: what is left of them, in the same frame [m].
    """
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
    """Return which of a sample of the readings have no point near them, and the indices of the sample.

    Args:
        readings: all of the scan [m].
        points: what is left of them [m].
    """
    chosen = np.arange(0, len(readings), max(1, len(readings) // SAMPLE_SIZE))
    num_neighbors = min(NUM_NEIGHBORS, len(readings) - 1)
    if num_neighbors < 1 or not len(points):
        return np.full(len(chosen), not len(points)), chosen
    reach = cKDTree(readings).query(readings[chosen], k=num_neighbors + 1)[0][:, -1]
    spacing = reach * np.sqrt(np.pi / num_neighbors)
    distance = cKDTree(points).query(readings[chosen])[0]
    return distance > np.maximum(REACH * spacing, MIN_REACH), chosen
>>>>>>> surface
