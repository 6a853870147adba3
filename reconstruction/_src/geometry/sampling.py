"""Points sampled on surfaces, and over boxes in plan: on a grid, in the middle of cells, and evenly spread."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.geometry.rows import find_areas

if TYPE_CHECKING:
    import trimesh

_PLASTIC_NUMBER = 1.32471795724474602596
"""The real root of x^3 = x + 1; its powers are the steps of the R2 sequence."""
_MARGIN = 1e-3
"""Reach of a grid beyond the corners [m]: what ends at them is seen from both sides."""


def sample_area(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    num_samples: int,
    rng: np.random.Generator | int = 0,
) -> Float[np.ndarray, "{num_samples} 3"]:
    """Return points spread evenly over the area of the faces: one in each of `num_samples` shares of the area."""
    rng = np.random.default_rng(rng)
    areas = find_areas(vertices, faces)
    place = (np.arange(num_samples) + rng.random(num_samples)) / num_samples * areas.sum()
    face = np.minimum(np.searchsorted(np.cumsum(areas), place), len(faces) - 1)
    root, split = np.sqrt(rng.random((num_samples, 1))), rng.random((num_samples, 1))
    a, b, c = (vertices[faces[face, k]] for k in range(3))
    return (1 - root) * a + root * (1 - split) * b + root * split * c


def sample_surface(
    mesh: trimesh.Trimesh, num_samples: int, rng: np.random.Generator | int = 0
) -> tuple[Float[np.ndarray, "{num_samples} 3"], Int[np.ndarray, " {num_samples}"]]:
    """Return independent points, uniform over the area of a mesh, and their faces: trimesh's sampler.

    `sample_area` needs fewer points for the same accuracy; this draws what trimesh draws.
    """
    import trimesh

    found = trimesh.sample.sample_surface(mesh, num_samples, seed=rng)
    return np.asarray(found[0]), np.asarray(found[1])


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
