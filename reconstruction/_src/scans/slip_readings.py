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
