"""Readings that pre-processing dropped, and how far from the scanner they were."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

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
