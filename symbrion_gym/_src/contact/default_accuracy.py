"""The accuracy that a scan allows: about its noise and spacing, never finer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.distances import find_nearest


@dataclass(frozen=True)
class AccuracyConfig:
    """How the default accuracy follows from a scan.

    Attributes:
        finest: contact need not be closer [m]: a Scout's tracks do not feel 3 mm ...
        extent: ... or this share of the extent of the surface, for small things.
        noise: in standard deviations of the readings from the surface.
        spacing: in median distances of neighboring readings over the surface.
        mesh: without readings, in median lengths of the edges of the surface ...
        coarsest: ... but no more than this many times the finest: a drawn mesh with long edges is exact.
        num_points: readings that are looked at.
    """

    finest: float = 0.003
    extent: float = 1.0 / 500.0
    noise: float = 1.0
    spacing: float = 0.1
    mesh: float = 0.05
    coarsest: float = 2.0
    num_points: int = 5000


ACCURACY_DEFAULTS = AccuracyConfig()
_DEVIATION = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute values."""


def find_accuracy(
    surface: trimesh.Trimesh,
    points: Float[np.ndarray, "N 3"] | None = None,
    config: AccuracyConfig = ACCURACY_DEFAULTS,
) -> float:
    """Return the accuracy that contact geometry of a scanned surface should have [m].

    The median distance of readings from the surface gives their noise; spacing is that of the surface's area, so
    that dense readings near the scanner do not stand for those far from it.
    """
    finest = min(config.finest, config.extent * float(surface.extents.max()))
    if points is None or len(points) < 2:
        edges = config.mesh * float(np.median(surface.edges_unique_length))
        return min(max(finest, edges), config.coarsest * finest)
    rng = np.random.default_rng(0)
    chosen = np.sort(rng.permutation(len(points))[: config.num_points])
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    residual, _, _ = find_nearest(points[chosen], vertices, faces)
    noise = _DEVIATION * float(np.median(residual))
    samples = sample_area(vertices, faces, config.num_points)
    tree = cKDTree(points)
    _, nearest = tree.query(samples)
    distance, _ = tree.query(points[nearest], k=2)
    spacing = float(np.median(distance[:, 1]))
    return max(finest, config.noise * noise, config.spacing * spacing)
