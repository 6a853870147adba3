"""How far the contact pieces of an arena lie from its surface."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class ArenaQuality:
    """Vertical distances between what is touched and the surface, on a grid of 1 cm.

    Attributes:
        mean: mean distance [m].
        p95: 95th percentile [m].
        max: largest [m].
        num_pieces: number of contact pieces.
        seconds: time that the decomposition took [s].
    """

    mean: float
    p95: float
    max: float
    num_pieces: int
    seconds: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON."""
        return asdict(self)
