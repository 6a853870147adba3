"""How far the contact pieces of an arena lie from its surface."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import trimesh

from symbrion_gym.elevation import Elevation

_MAX_RAYS = 400_000


@dataclass(frozen=True)
class ArenaQuality:
    """Vertical distances between what is touched and the surface, on a grid; 2 cm around walls left out.

    Attributes:
        mean: mean distance [m].
        p95: 95th percentile [m].
        max: largest [m].
        bias: mean of touched minus surface: above 0 where the ground is lifted [m].
        uncovered: share of the surface with nothing to touch beneath it.
        num_pieces: number of contact pieces.
        seconds: time that the decomposition took [s].
    """

    mean: float
    p95: float
    max: float
    num_pieces: int
    bias: float = 0.0
    uncovered: float = 0.0
    seconds: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON."""
        return asdict(self)


def measure_arena(
    pieces: list[trimesh.Trimesh],
    surface: trimesh.Trimesh,
    *,
    region: trimesh.Trimesh | None = None,
    spacing: float = 0.01,
    margin: float = 0.02,
    seconds: float = 0.0,
) -> ArenaQuality:
    """Compare the top of the pieces with a surface along vertical lines.

    Args:
        pieces: contact pieces.
        surface: what they should be: the mesh they were made of, or the truth.
        region: a mesh that bounds where to look, if not the whole surface.
        spacing: of the grid; wider where the surface is large (at most 400,000 lines) [m].
        margin: distance around walls (a rise of more than 2 per 1) that is left out [m].
        seconds: to be noted in the result.
    """
    low, high = (region or surface).bounds[:, :2]
    spacing = max(spacing, float(np.sqrt(np.prod(high - low) / _MAX_RAYS)))
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    x, y = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
    elevation = Elevation(surface)
    is_there = np.isfinite(elevation.height(x, y))
    if region is not None:
        is_there &= np.isfinite(Elevation(region).height(x, y))
    x, y = x[is_there], y[is_there]
    wanted = elevation.height(x, y)
    is_open = find_relief(elevation, x, y, margin) < 2.0 * margin
    touched = Elevation(*pieces).height(x, y)
    is_touched = np.isfinite(touched)
    gap = (touched - wanted)[is_open & is_touched]
    if not len(gap):
        return ArenaQuality(np.inf, np.inf, np.inf, len(pieces), np.inf, 1.0, seconds)
    return ArenaQuality(
        mean=float(np.abs(gap).mean()),
        p95=float(np.percentile(np.abs(gap), 95)),
        max=float(np.abs(gap).max()),
        bias=float(gap.mean()),
        uncovered=float(1.0 - is_touched.mean()),
        num_pieces=len(pieces),
        seconds=seconds,
    )


def find_relief(elevation: Elevation, x: np.ndarray, y: np.ndarray, radius: float) -> np.ndarray:
    """Return the difference of the highest and lowest point within a radius of each (x, y) [m]."""
    center = elevation.height(x, y)
    highest, lowest = center.copy(), center.copy()
    for angle in np.arange(16) * np.pi / 8:
        around = elevation.height(x + radius * np.cos(angle), y + radius * np.sin(angle))
        highest, lowest = np.fmax(highest, around), np.fmin(lowest, around)
    return highest - lowest
