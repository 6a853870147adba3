"""Quality of an arena measured against the scan that it was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import trimesh

from symbrion_gym._src.arenas.exact_readings import simulate_readings
from symbrion_gym._src.arenas.scanned import ScannedSurface
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.contact.visibility import VisibilityConfig, add_visibility, measure_visibility


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
    """
    quality = replace(quality, dropped=scanned.dropped)
    points, seen_from = scanned.points, scanned.seen_from
    if scanned.viewpoints is None:
        return quality
    if points is None:
        points, seen_from = simulate_readings(surface, scanned.viewpoints)
    visibility = measure_visibility(points, scanned.viewpoints, seen_from, contact, surface, config)
    return add_visibility(quality, visibility)
