"""How far the contact pieces of an arena lie from its surface."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import trimesh
from scipy.ndimage import maximum_filter, minimum_filter

from reconstruction.files.typed_json import JsonError, as_type
from reconstruction.geometry.elevation import Elevation
from symbrion_gym.errors import ArenaError

_MAX_RAYS = 400_000


@dataclass(frozen=True)
class ArenaQuality:
    """Distances between what is touched and the surface.

    Of a terrain: vertical, on a grid, 2 cm around walls left out. Of a closed body and of a surface with overhangs,
    of which a vertical line sees one side only: of points all over the surface from the skin of the pieces.

    Attributes:
        mean: mean distance [m]; inf where there is no ground to measure on, as are the next three.
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


class TerrainRuler:
    """Measures one set of pieces after another against a terrain, along vertical lines."""

    def __init__(
        self,
        surface: trimesh.Trimesh,
        *,
        region: trimesh.Trimesh | None = None,
        spacing: float = 0.01,
        margin: float = 0.02,
    ) -> None:
        """Look at the surface; arguments as those of `measure_arena`."""
        low, high = (region or surface).bounds[:, :2]
        spacing = max(spacing, float(np.sqrt(np.prod(high - low) / _MAX_RAYS)))
        axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
        self._x, self._y = np.meshgrid(*axes, indexing="ij")
        self._wanted = Elevation(surface).height(self._x, self._y)
        self._is_there = np.isfinite(self._wanted)
        if region is not None:
            self._is_there &= np.isfinite(Elevation(region).height(self._x, self._y))
        self._is_open = self._is_there & (_find_relief(self._wanted, margin / spacing) < 2.0 * margin)

    def measure(self, pieces: list[trimesh.Trimesh], seconds: float = 0.0) -> ArenaQuality:
        """Compare the top of the pieces with the surface."""
        touched = Elevation(*pieces).height(self._x, self._y)
        is_touched = np.isfinite(touched)
        gap = (touched - self._wanted)[self._is_open & is_touched]
        if not len(gap):
            return ArenaQuality(np.inf, np.inf, np.inf, len(pieces), np.inf, 1.0, seconds)
        return ArenaQuality(
            mean=float(np.abs(gap).mean()),
            p95=float(np.percentile(np.abs(gap), 95)),
            max=float(np.abs(gap).max()),
            bias=float(gap.mean()),
            uncovered=float(1.0 - is_touched[self._is_there].mean()),
            num_pieces=len(pieces),
            seconds=seconds,
        )


class BodyRuler:
    """Measures one set of pieces after another against a body, at points strewn over it, whichever way it faces.

    A point inside a piece lies as deep as the nearest plane of that piece is far. One outside of all pieces counts
    as uncovered from 1 % of the extent on.
    """

    def __init__(self, surface: trimesh.Trimesh, count: int = 4000) -> None:
        """Strew `count` points over the surface."""
        self._points = np.asarray(trimesh.sample.sample_surface(surface, count, seed=0)[0])
        self._reach = 0.01 * float(surface.extents.max())

    def measure(self, pieces: list[trimesh.Trimesh], seconds: float = 0.0) -> ArenaQuality:
        """Compare the skin of the pieces with the surface."""
        outside = np.full(len(self._points), np.inf)
        for piece in pieces:
            normals = np.asarray(piece.face_normals)
            offsets = np.einsum("fi,fi->f", normals, np.asarray(piece.triangles)[:, 0])
            outside = np.minimum(outside, (self._points @ normals.T - offsets).max(axis=1))
        is_covered = outside < self._reach
        if not is_covered.any():
            return ArenaQuality(np.inf, np.inf, np.inf, len(pieces), np.inf, 1.0, seconds)
        gap = np.abs(outside[is_covered])
        return ArenaQuality(
            mean=float(gap.mean()),
            p95=float(np.percentile(gap, 95)),
            max=float(gap.max()),
            bias=float(-outside[is_covered].mean()),
            uncovered=float(1.0 - is_covered.mean()),
            num_pieces=len(pieces),
            seconds=seconds,
        )


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
    ruler = TerrainRuler(surface, region=region, spacing=spacing, margin=margin)
    return ruler.measure(pieces, seconds)


def _find_relief(heights: np.ndarray, radius: float) -> np.ndarray:
    """Difference of the highest and lowest point within a radius (in cells) on a grid with gaps (NaN)."""
    reach = max(int(np.ceil(radius - 1e-6)), 1)
    steps = np.arange(-reach, reach + 1)
    disc = np.hypot(*np.meshgrid(steps, steps)) <= max(radius, 1.0) + 1e-6
    is_gap = np.isnan(heights)
    highest = maximum_filter(np.where(is_gap, -np.inf, heights), footprint=disc, mode="nearest")
    lowest = minimum_filter(np.where(is_gap, np.inf, heights), footprint=disc, mode="nearest")
    return highest - lowest
