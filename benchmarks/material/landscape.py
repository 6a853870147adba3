"""A made landscape of 1/f noise whose height is known everywhere, and scans of it of any size, streamed."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.ndimage import map_coordinates

from reconstruction._src.base.atomic_write import write_atomically

_CHUNK = 1_000_000


class Landscape(NamedTuple):
    """Heights on a square grid, smooth between (cubic splines' linear cousin: bilinear).

    Attributes:
        heights: `[R, R]` rows along y [m].
        extent: edge of the square [m]; its lower corner is the origin.
    """

    heights: Float[np.ndarray, "R R"]
    extent: float

    def height(self, x: Float[np.ndarray, " N"], y: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Return the true height [m]."""
        scale = (len(self.heights) - 1) / self.extent
        return map_coordinates(self.heights, [y * scale, x * scale], order=1, mode="nearest")


def make_landscape(
    extent: float, spacing: float, relief: float, roughness: float = 2.0, seed: int = 0
) -> Landscape:
    """Make a landscape by spectral synthesis.

    Args:
        extent: edge of the square [m].
        spacing: spacing of the grid [m].
        relief: standard deviation of the heights [m].
        roughness: amplitudes fall with the frequency to this power; 2 looks like hills.
        seed: equal seeds give equal landscapes.
    """
    count = round(extent / spacing) + 1
    frequency = np.hypot(*np.meshgrid(np.fft.rfftfreq(count), np.fft.fftfreq(count)))
    frequency[0, 0] = np.inf
    rng = np.random.default_rng(seed)
    spectrum = rng.normal(size=frequency.shape) + 1j * rng.normal(size=frequency.shape)
    heights = np.fft.irfft2(spectrum / frequency**roughness, s=(count, count))
    return Landscape(relief * (heights - heights.mean()) / heights.std(), extent)


def sample_scan(
    landscape: Landscape, count: int, noise: float, rng: np.random.Generator
) -> Float[np.ndarray, "N 3"]:
    """Return points of a scan from above: evenly distributed by chance, with noise in height [m]."""
    x, y = rng.uniform(0.0, landscape.extent, (2, count))
    return np.stack([x, y, landscape.height(x, y) + rng.normal(0.0, noise, count)], axis=1)


def write_scan(path: Path, landscape: Landscape, count: int, noise: float = 0.02, seed: int = 0) -> None:
    """Write a scan of any size as .npy in single precision, chunk by chunk: 12 bytes a point."""
    rng = np.random.default_rng(seed)
    with write_atomically(path) as temporary:
        rows = np.lib.format.open_memmap(temporary, mode="w+", dtype=np.float32, shape=(count, 3))
        for start in range(0, count, _CHUNK):
            size = min(_CHUNK, count - start)
            rows[start : start + size] = sample_scan(landscape, size, noise, rng)
        rows.flush()
