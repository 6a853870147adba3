"""Quality of an arena measured against the scan that it was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import trimesh

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.scanned import ScannedSurface, simulate_readings
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.contact.visibility import add_visibility, measure_visibility


def add_scan_quality(
    quality: ArenaQuality,
    scanned: ScannedSurface,
    contact: Sequence[trimesh.Trimesh] | HeightField,
    surface: trimesh.Trimesh,
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
    visibility = measure_visibility(points, scanned.viewpoints, seen_from, contact, surface)
    return add_visibility(quality, visibility)


@dataclass(frozen=True)
class AccuracyReport:
    """The accuracy of an arena, asked for and reached."""

    # mean distance of contact from the surface that was asked for, or follows from the scan [m]; None:
    # nothing was asked for, as of a course made in code
    wanted: float | None
    reached: float  # the mean distance [m]
    is_reached: bool  # whether the arena is as accurate as wanted, all over, and within the number of pieces
    # (x, y, z) of the point of the surface with the largest distance [m]; None where that is not noted
    worst: tuple[float, float, float] | None = None
    distance: float | None = None  # its distance from contact [m]
    # what a user should know, one line each; that of a missed accuracy names the worst place and a remedy
    warnings: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON: None for what is not finite."""
        return {
            name: None if isinstance(value, float) and not np.isfinite(value) else value
            for name, value in asdict(self).items()
        }


def report_accuracy(arena: Arena) -> AccuracyReport:
    """Return what the making of an arena has noted about its accuracy."""
    notes, reached = arena.provenance, arena.quality.mean
    wanted = notes.get("accuracy")
    is_reached = notes.get("is_reached", wanted is None or reached <= wanted)
    worst: dict[str, Any] = notes.get("worst") or {}
    place = worst.get("place")
    return AccuracyReport(
        wanted=wanted,
        reached=reached,
        is_reached=bool(is_reached),
        worst=None if place is None else (place[0], place[1], place[2]),
        distance=worst.get("distance"),
        warnings=tuple(notes.get("warnings", ())),
    )
