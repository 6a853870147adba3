"""How well the contact of an arena follows its surface, as numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.typed_json import JsonError, as_type
from symbrion_gym._src.errors import ArenaError

_DISTANCES = ("mean", "p95", "max", "seconds", "protrusion_mean", "protrusion_p95", "protrusion_max")
_SHARES = ("uncovered", "beams_contact", "beams_surface", "free_space", "dropped")


@dataclass(frozen=True)
class ArenaQuality:
    """Distances between contact geometry and the surface, of points all over both: walls and overhangs included.

    Attributes:
        mean: mean distance of the surface from contact [m]; inf where there is nothing to measure on, as are the
            next two and the bias.
        p95: 95th percentile [m].
        max: largest [m].
        bias: mean distance, above 0 where contact stands in front of the surface, below where behind [m].
        uncovered: share of the surface without contact geometry within 5 cm.
        num_pieces: number of contact pieces.
        seconds: time that the decomposition took [s].
        protrusion_mean: mean distance of points on the exposed side of the contact geometry from the
            surface: how far contact stands in front of it [m]. None where not measured, as are all below.
        protrusion_p95: 95th percentile [m].
        protrusion_max: largest [m].
        beams_contact: share of the scanner's beams that end on contact geometry within 5 cm of their reading.
        beams_surface: the same share on the surface, which bounds what contact can reach.
        free_space: share of the space that the scanner saw to be free that is inside contact geometry.
        dropped: share of the readings that pre-processing dropped.

    Raises:
        ArenaError: a field is out of range.
    """

    mean: float
    p95: float
    max: float
    num_pieces: int
    bias: float = 0.0
    uncovered: float = 0.0
    seconds: float = 0.0
    protrusion_mean: float | None = None
    protrusion_p95: float | None = None
    protrusion_max: float | None = None
    beams_contact: float | None = None
    beams_surface: float | None = None
    free_space: float | None = None
    dropped: float | None = None

    def __post_init__(self) -> None:
        for name in (*_DISTANCES, "num_pieces"):
            value = getattr(self, name)
            if value is not None and not value >= 0:
                raise ArenaError(f"{name} is {value}; 0 or more is needed")
        for name in _SHARES:
            value = getattr(self, name)
            if value is not None and not 0 <= value <= 1:
                raise ArenaError(f"{name} is {value}; a share from 0 to 1 is needed")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON: without those not measured, None where there was nothing to measure on."""
        measured = {name: value for name, value in asdict(self).items() if value is not None}
        return {name: value if np.isfinite(value) else None for name, value in measured.items()}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> ArenaQuality:
        """Return what `as_dict` was made of."""
        known = {name: np.inf if value is None else value for name, value in fields.items()}
        try:
            return as_type(known, cls, "quality")
        except JsonError as error:
            raise ArenaError(str(error)) from error

    @classmethod
    def of_gaps(
        cls,
        gaps: Float[np.ndarray, " N"],
        uncovered: float,
        num_pieces: int,
        seconds: float,
        protrusions: Float[np.ndarray, " M"] | None = None,
    ) -> ArenaQuality:
        """Summarize signed distances of contact from the surface [m], above 0 where contact stands in front of it."""
        if not len(gaps) or not np.isfinite(gaps).all():
            return cls(np.inf, np.inf, np.inf, num_pieces, np.inf, 1.0, seconds)
        distances = np.abs(gaps)
        has_protrusions = protrusions is not None and len(protrusions) > 0
        p_mean, p_p95, p_max = (
            (float(protrusions.mean()), float(np.percentile(protrusions, 95)), float(protrusions.max()))
            if protrusions is not None and has_protrusions
            else (None, None, None)
        )
        return cls(
            protrusion_mean=p_mean,
            protrusion_p95=p_p95,
            protrusion_max=p_max,
            mean=float(distances.mean()),
            p95=float(np.percentile(distances, 95)),
            max=float(distances.max()),
            bias=float(gaps.mean()),
            uncovered=uncovered,
            num_pieces=num_pieces,
            seconds=seconds,
        )
