"""Quality of an arena measured against the scan that it was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction.geometry.sampling import sample_area
from symbrion_gym.arenas.scanned import ScannedSurface
from symbrion_gym.contact.kinds import HeightField
from symbrion_gym.contact.quality import ArenaQuality
from symbrion_gym.contact.ray_mesh import RayMesh
from symbrion_gym.contact.visibility import VisibilityConfig, add_visibility, measure_visibility

_HIDDEN = 1e-3
"""A point of a surface is hidden where the surface is nearer to the viewpoint by more than this [m]."""


def add_scan_quality(
    quality: ArenaQuality,
    scanned: ScannedSurface,
    contact: Sequence[trimesh.Trimesh] | HeightField,
    surface: trimesh.Trimesh,
    config: VisibilityConfig | None = None,
) -> ArenaQuality:
    """Return the quality of an arena with the shares of beams, of free space and of dropped readings.

    What the scan does not tell stays None: beams and free space without viewpoints. With viewpoints and without
    readings, exact readings of the surface take their place.

    Args:
        quality: distances, as measured before.
        scanned: what the arena was made of, in its frame.
        contact: convex pieces, or the height field in their place.
        surface: the arena's surface.
        config: how beams are compared.
    """
    quality = replace(quality, dropped=scanned.dropped)
    points, seen_from = scanned.points, scanned.seen_from
    if scanned.viewpoints is None:
        return quality
    if points is None:
        points, seen_from = simulate_readings(surface, scanned.viewpoints)
    visibility = measure_visibility(points, scanned.viewpoints, seen_from, contact, surface, config)
    return add_visibility(quality, visibility)


def simulate_readings(
    surface: trimesh.Trimesh, viewpoints: Float[np.ndarray, "K 3"], num_points: int = 20_000
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return exact readings of a surface whose scan is not known, and the viewpoint of each.

    Args:
        surface: what is seen.
        viewpoints: positions of the scanner [m].
        num_points: points spread over the surface, of which each viewpoint reads those that it sees.
    """
    vertices = np.asarray(surface.vertices, dtype=np.float64)
    points = sample_area(vertices, np.asarray(surface.faces, dtype=np.int64), num_points)
    rays, found, seen_from = RayMesh([surface]), [], []
    for index, viewpoint in enumerate(viewpoints):
        ways = points - viewpoint
        ranges = np.maximum(np.linalg.norm(ways, axis=1), _HIDDEN)
        is_seen = rays.cast(np.tile(viewpoint, (len(points), 1)), ways / ranges[:, None]) >= ranges - _HIDDEN
        found.append(points[is_seen])
        seen_from.append(np.full(int(is_seen.sum()), index))
    return np.concatenate(found), np.concatenate(seen_from)
