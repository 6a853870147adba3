"""What a robot reads while one of its modules drags its tracks over the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ScanError

_COLUMNS = {"times": 1, "runs": 1, "positions": 2, "headings": 1, "pitches": 1, "commanded": 1}
_COLUMNS |= {"accelerations": 2, "forces": 2}
"""Field -> number of its axes."""


@dataclass(frozen=True, eq=False, repr=False)
class SlipReadings:
    """Readings of one module of a robot, one row a control tick.

    The module drives with the others, or against them: then its tracks slip and the dock between it and the others
    holds what the ground gives. The frame of the module is x ahead, y left, z up, away from the ground.

    Attributes:
        times: of the readings [s].
        runs: number of the uninterrupted drive that each belongs to.
        positions: places of the module in the world, by localization [m].
        headings: its heading [rad].
        pitches: its pitch, above 0 nose up [rad].
        commanded: speed of its tracks as commanded [m/s].
        accelerations: what its accelerometers read, gravity included, in its frame [m/s²].
        forces: what the dock pulls at it, in its frame [N].
        mass: its mass [kg].

    Raises:
        ScanError: arrays of other shapes or lengths, numbers that are not finite, or no mass.
    """

    times: Float[np.ndarray, " T"]
    runs: Int[np.ndarray, " T"]
    positions: Float[np.ndarray, "T 3"]
    headings: Float[np.ndarray, " T"]
    pitches: Float[np.ndarray, " T"]
    commanded: Float[np.ndarray, " T"]
    accelerations: Float[np.ndarray, "T 3"]
    forces: Float[np.ndarray, "T 3"]
    mass: float

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.times))
        for name, axes in _COLUMNS.items():
            kind = np.int64 if name == "runs" else np.float64
            array = np.asarray(getattr(self, name), dtype=kind)
            wanted = (count,) if axes == 1 else (count, 3)
            if array.shape != wanted:
                raise ScanError(f"slip readings: {name} has shape {array.shape}; {count} times need {wanted}")
            if not np.isfinite(array).all():
                raise ScanError(f"slip readings: {name} must be finite; leave out ticks without a reading")
            object.__setattr__(self, name, array)
        object.__setattr__(self, "mass", float(self.mass))
        if not 0.0 < self.mass < np.inf:
            raise ScanError(f"slip readings: mass must be above 0, got {self.mass}")

    def __repr__(self) -> str:
        return f"SlipReadings({len(self.times)} ticks in {len(np.unique(self.runs))} runs)"

    def __len__(self) -> int:
        return len(self.times)


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
