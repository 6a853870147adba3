"""Which ground a scanner saw: places that nothing hides from all of its positions."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from symbrion_gym._src.contact.quality import RayMesh

MOST_VIEWPOINTS = 64  # As many positions of the scanner are kept with an arena, evenly spread over the scan
_ABOVE = 0.05
"""Height above a place of what must be seen [m]: the surface is as far off its readings, and a robot is higher."""


class SeenPlaces:
    """Tells which places on the ground a scanner saw."""

    def __init__(self, surface: trimesh.Trimesh, viewpoints: Float[np.ndarray, "K 3"]) -> None:
        """Take a surface and the positions of the scanner [m]."""
        self._rays, self._viewpoints = RayMesh([surface]), np.asarray(viewpoints, dtype=np.float64)

    def __call__(self, places: Float[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return whether a viewpoint sees what is a little above each place [m]."""
        targets, is_seen = places + np.array([0.0, 0.0, _ABOVE]), np.zeros(len(places), dtype=bool)
        for viewpoint in self._viewpoints:
            left = np.flatnonzero(~is_seen)
            ways = targets[left] - viewpoint
            ranges = np.maximum(np.linalg.norm(ways, axis=1), _ABOVE)
            free = self._rays.cast(np.tile(viewpoint, (len(left), 1)), ways / ranges[:, None])
            is_seen[left] = free >= ranges
        return is_seen


def choose_positions(viewpoints: Float[np.ndarray, "K 3"] | None) -> list[list[float]] | None:
    """Return the positions of a scanner that are kept with an arena, to 1 mm; None where they are unknown."""
    if viewpoints is None or not len(viewpoints):
        return None
    kept = np.unique(np.linspace(0, len(viewpoints) - 1, min(len(viewpoints), MOST_VIEWPOINTS)).astype(int))
    return np.round(viewpoints[kept], 3).tolist()
