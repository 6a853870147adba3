"""Points over a rectangle in plan: on a grid, on a grid of cells, and evenly spread."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

_MARGIN = 1e-3
"""Reach of a grid beyond the corners [m]: what ends at them is seen from both sides."""
_PLASTIC_NUMBER = 1.32471795724474602596
"""The real root of x³ = x + 1, on which the R2 sequence is built."""


def sample_cells(
    low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"], spacing: float
) -> Float[np.ndarray, "X Y 2"]:
    """Return the centers (x, y) of the grid cells of a width `spacing` between two corners."""
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def sample_grid(
    corners: Float[np.ndarray, "V D"], count: int, margin: float = _MARGIN
) -> Float[np.ndarray, "N 2"]:
    """Return a grid of `count` squared points (x, y) over the box around corners in plan, and a margin [m]."""
    low, high = corners[:, :2].min(axis=0) - margin, corners[:, :2].max(axis=0) + margin
    axes = [np.linspace(low[i], high[i], count) for i in range(2)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def sample_evenly(
    low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"], count: int
) -> Float[np.ndarray, "count 2"]:
    """Return `count` points (x, y) spread evenly between two corners, in no rows.

    References:
        Roberts (2018), The unreasonable effectiveness of quasirandom sequences: the R2 sequence.
    """
    steps = np.arange(1, count + 1)[:, None] / _PLASTIC_NUMBER ** np.array([1, 2])
    return low + (high - low) * np.mod(steps, 1.0)
