"""Friction by place that grows with every survey: new readings replace old ones at the same place."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.slip.drags import FrictionReadings, SlipPriors, find_friction
from reconstruction._src.slip.readings import SlipReadings

REPLACED = 0.2
"""Old readings this close to a new one are out of date [m]: twice the way from one drag to the next."""


def join_slip(
    known: FrictionReadings | None,
    slip: SlipReadings | None,
    offset: Float[np.ndarray, " 3"],
    priors: SlipPriors | None = None,
) -> FrictionReadings | None:
    """Return friction by place after new slip; the known one where there is none."""
    if slip is None:
        return known
    if not isinstance(slip, SlipReadings):
        raise ReconstructionError(
            f"slip must be SlipReadings, as `ScanLog.slip` is, got {type(slip).__name__}"
        )
    new = find_friction(slip, priors)
    new = new._replace(places=new.places - offset)
    if known is None or not len(new.frictions):
        return new if known is None else known
    from scipy.spatial import cKDTree

    distance = cKDTree(new.places).query(known.places)[0]
    kept = FrictionReadings(*(array[distance > REPLACED] for array in known))
    shift = int(kept.runs.max()) + 1 if len(kept.runs) else 0
    new = new._replace(runs=new.runs + shift)
    return FrictionReadings(*(np.concatenate(pair) for pair in zip(kept, new, strict=True)))


def read_slip_arrays(arrays: Mapping[str, np.ndarray]) -> FrictionReadings | None:
    """Return friction by place from the arrays `slip_...` of a file; None where there are none."""
    if "slip_places" not in arrays:
        return None
    found = FrictionReadings(*(np.asarray(arrays[f"slip_{name}"]) for name in FrictionReadings._fields))
    count = len(found.places)
    is_right = found.places.shape == (count, 3) and all(array.shape == (count,) for array in found[1:])
    if not is_right or not all(np.isfinite(array).all() for array in found):
        raise ReconstructionError("slip must be finite numbers of one length; restore the file from a copy")
    return found
