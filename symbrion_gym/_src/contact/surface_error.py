"""Surface error along vertical lines: for terrains, independent of the distances in 3-D that passes are judged by."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.ndimage import maximum_filter, minimum_filter

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.sampling import sample_cells
from symbrion_gym._src.contact.quality import ArenaQuality

_MAX_RAYS = 400_000
"""Vertical lines at most: bounds the time and memory that a large terrain takes."""
_ROUNDING = 1e-6
"""Keeps a radius of a whole number of cells from becoming one more [cells]."""


class TerrainErrorMetric:
    """Surface error of one set of pieces after another against a terrain, along vertical lines."""

    def __init__(
        self,
        surface: trimesh.Trimesh,
        ground: Elevation,
        *,
        region: trimesh.Trimesh | None = None,
        spacing: float = 0.01,
        margin: float = 0.02,
    ) -> None:
        """Measure the heights of the surface."""
        low, high = (region or surface).bounds[:, :2]
        spacing = max(spacing, float(np.sqrt(np.prod(high - low) / _MAX_RAYS)))
        grid = sample_cells(low, high, spacing)
        self._x, self._y = grid[..., 0], grid[..., 1]
        self._wanted = ground.height(self._x, self._y)
        self._is_there = np.isfinite(self._wanted)
        if region is not None:
            self._is_there &= np.isfinite(Elevation(region).height(self._x, self._y))
        self._is_open = self._is_there & (_find_relief(self._wanted, margin / spacing) < 2.0 * margin)

    def measure(self, pieces: list[trimesh.Trimesh], seconds: float = 0.0) -> ArenaQuality:
        """Compare the top of the pieces with the surface."""
        touched = Elevation(*pieces).height(self._x, self._y)
        is_touched = np.isfinite(touched)
        gaps = (touched - self._wanted)[self._is_open & is_touched]
        uncovered = float(1.0 - is_touched[self._is_there].mean()) if len(gaps) else 1.0
        return ArenaQuality.of_gaps(gaps, uncovered, len(pieces), seconds)


def measure_arena(
    pieces: list[trimesh.Trimesh],
    surface: trimesh.Trimesh,
    *,
    region: trimesh.Trimesh | None = None,
    spacing: float = 0.01,
    margin: float = 0.02,
    seconds: float = 0.0,
) -> ArenaQuality:
    """Compare the top of the pieces with a surface along vertical lines."""
    metric = TerrainErrorMetric(surface, Elevation(surface), region=region, spacing=spacing, margin=margin)
    return metric.measure(pieces, seconds)


def _find_relief(heights: Float[np.ndarray, "X Y"], radius: float) -> Float[np.ndarray, "X Y"]:
    """Return the difference of the highest and lowest point within a radius (in cells) on a grid with gaps (NaN)."""
    reach = max(int(np.ceil(radius - _ROUNDING)), 1)
    steps = np.arange(-reach, reach + 1)
    disc = np.hypot(*np.meshgrid(steps, steps)) <= max(radius, 1.0) + _ROUNDING
    is_gap = np.isnan(heights)
    highest = maximum_filter(np.where(is_gap, -np.inf, heights), footprint=disc, mode="nearest")
    lowest = minimum_filter(np.where(is_gap, np.inf, heights), footprint=disc, mode="nearest")
    return highest - lowest
