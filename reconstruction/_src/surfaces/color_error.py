"""How far the colors of a surface are from the true ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.surfaces.color import WHITE, find_vertex_colors, interpolate_colors

Paint = Callable[[Float[np.ndarray, "N 3"]], ArrayLike]
"""Returns the colors of positions [m], 0 to 1."""
_EDGE_STEP = 0.1
"""A change of a channel by more than this is an edge, of 1."""


class ColorError(NamedTuple):
    """How far the colors of a surface are from the true ones; of 1, over red, green and blue.

    Attributes:
        rmse: root of the mean square, away from the edges of the true colors.
        p95: 95th percentile of the absolute difference there.
        rmse_everywhere: with the edges.
        away: share of the samples that are away from edges.
    """

    rmse: float
    p95: float
    rmse_everywhere: float
    away: float


def measure_color_error(
    mesh: trimesh.Trimesh,
    truth: Paint | trimesh.Trimesh,
    edge: float = 0.05,
    num_samples: int = 20_000,
    seed: int = 0,
) -> ColorError:
    """Compare the vertex colors of a mesh with the true ones at samples of its surface."""
    colors = find_vertex_colors(mesh)
    if colors is None:
        raise ReconstructionError("the mesh has no vertex colors; give reconstruct() colored points")
    ask = _make_lookup(truth) if isinstance(truth, trimesh.Trimesh) else truth
    places = sample_area(np.asarray(mesh.vertices), np.asarray(mesh.faces), num_samples, seed)
    found = interpolate_colors(mesh, colors, places) / WHITE
    true = np.asarray(ask(places), dtype=np.float64)
    away = _find_away(ask, places, true, edge)
    error = np.abs(found - true)
    rest = error[away] if away.any() else np.full((1, 3), np.nan)
    return ColorError(
        float(np.sqrt((rest**2).mean())),
        float(np.percentile(rest, 95)),
        float(np.sqrt((error**2).mean())),
        float(away.mean()),
    )


def _find_away(
    ask: Paint,
    places: Float[np.ndarray, "S 3"],
    true: Float[np.ndarray, "S 3"],
    edge: float,
) -> Bool[np.ndarray, " S"]:
    """Return which places have the same color all around."""
    away = np.ones(len(places), dtype=bool)
    for axis in range(3):
        for sign in (-edge, edge):
            around = np.asarray(ask(places + sign * np.eye(3)[axis]), dtype=np.float64)
            away &= (np.abs(around - true) <= _EDGE_STEP).all(axis=1)
    return away


def _make_lookup(mesh: trimesh.Trimesh) -> Paint:
    colors = find_vertex_colors(mesh)
    if colors is None:
        raise ReconstructionError("the true mesh has no vertex colors; give a function of positions instead")

    def ask(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
        return interpolate_colors(mesh, colors, places) / WHITE

    return ask
