"""Quality of an arena measured against the scan that it was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction.geometry.sampling import sample_area
from reconstruction.scans.cloud import Cloud
from reconstruction.scans.dropped import DroppedConfig, find_dropped
from symbrion_gym.contact.kinds import HeightField
from symbrion_gym.contact.quality import ArenaQuality
from symbrion_gym.contact.ray_mesh import RayMesh
from symbrion_gym.contact.visibility import VisibilityConfig, add_visibility, measure_visibility

_HIDDEN = 1e-3
"""A point of a surface is hidden where the surface is nearer to the viewpoint by more than this [m]."""


def add_scan_quality(
    quality: ArenaQuality,
    readings: Cloud,
    kept: Float[np.ndarray, "M 3"] | None,
    contact: Sequence[trimesh.Trimesh] | HeightField,
    surface: trimesh.Trimesh,
    config: VisibilityConfig | None = None,
) -> ArenaQuality:
    """Return the quality of an arena with the shares of beams, of free space and of dropped readings.

    What the scan does not tell stays None: beams and free space without viewpoints.

    Args:
        quality: distances, as measured before.
        readings: all readings of the scan, in the frame of the arena.
        kept: the points that pre-processing kept; None where that is unknown, or it kept all.
        contact: convex pieces, or the height field in their place.
        surface: the arena's surface.
        config: how beams are compared.
    """
    if kept is not None and readings.num_points:
        quality = replace(quality, dropped=float(find_dropped(readings.points, kept, DroppedConfig()).mean()))
    if readings.viewpoints is None:
        return quality
    visibility = measure_visibility(
        readings.points, readings.viewpoints, readings.seen_from, contact, surface, config
    )
    return add_visibility(quality, visibility)


def simulate_readings(
    surface: trimesh.Trimesh, viewpoints: Float[np.ndarray, "K 3"], num_points: int = 20_000
) -> Cloud:
    """Return exact readings of a surface, for one whose scan is not known.

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
    return Cloud(np.concatenate(found), viewpoints=viewpoints, seen_from=np.concatenate(seen_from))
