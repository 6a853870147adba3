"""How well the contact of an arena follows its surface, as numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from reconstruction.files.typed_json import JsonError, as_type
from symbrion_gym.errors import ArenaError


@dataclass(frozen=True)
class ArenaQuality:
    """Distances between contact geometry and the surface.

    Of a terrain: vertical, on a grid, 2 cm around walls left out. Of a closed body and of a surface with overhangs,
    of which a vertical line sees one side only: of points all over the surface from the hulls of the pieces.

    Attributes:
        mean: mean distance [m]; inf where there is no ground to measure on, as are the next three.
        p95: 95th percentile [m].
        max: largest [m].
        bias: mean of contact minus surface: above 0 where the ground is lifted [m].
        uncovered: share of the surface without contact geometry beneath it.
        num_pieces: number of contact pieces.
        seconds: time that the decomposition took [s].

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

    def __post_init__(self) -> None:
        for name in ("mean", "p95", "max", "num_pieces", "seconds"):
            if not getattr(self, name) >= 0:
                raise ArenaError(f"{name} is {getattr(self, name)}; 0 or more is needed")
        if not 0 <= self.uncovered <= 1:
            raise ArenaError(f"uncovered is {self.uncovered}; a share from 0 to 1 is needed")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON: None where nothing could be measured."""
        return {name: value if np.isfinite(value) else None for name, value in asdict(self).items()}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> ArenaQuality:
        """Return what `as_dict` was made of.

        Raises:
            ArenaError: a field is missing, unknown, of another type or out of range.
        """
        known = {name: np.inf if value is None else value for name, value in fields.items()}
        try:
            return as_type(known, cls, "quality")
        except JsonError as error:
            raise ArenaError(str(error)) from error

    @classmethod
    def of_gaps(
        cls, gaps: Float[np.ndarray, " N"], uncovered: float, num_pieces: int, seconds: float
    ) -> ArenaQuality:
        """Summarize signed distances of contact from the surface [m], above 0 where the ground is lifted."""
        if not len(gaps):
            return cls(np.inf, np.inf, np.inf, num_pieces, np.inf, 1.0, seconds)
        distances = np.abs(gaps)
        return cls(
            mean=float(distances.mean()),
            p95=float(np.percentile(distances, 95)),
            max=float(distances.max()),
            bias=float(gaps.mean()),
            uncovered=uncovered,
            num_pieces=num_pieces,
            seconds=seconds,
        )
