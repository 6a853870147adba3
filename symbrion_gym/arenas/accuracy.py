"""Whether an arena is as accurate as was asked for; if not, where it is worst and what helps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from reconstruction.geometry.sampling import sample_area
from symbrion_gym.arenas.arena import Arena
from symbrion_gym.contact.offsets import find_offsets

_NUM_POINTS = 20_000
"""Points on the surface among which the worst place is looked for."""


@dataclass(frozen=True)
class AccuracyReport:
    """The accuracy of an arena, asked for and reached.

    Attributes:
        wanted: mean distance of contact from the surface that was asked for, or follows from the scan [m].
        reached: the mean distance [m].
        is_reached: whether the arena is as accurate as wanted, and within the number of pieces.
        worst: (x, y, z) of the point of the surface with the largest distance [m]; None where there is no contact.
        distance: its distance from contact [m].
        warnings: what a user should know, one line each; the last one names the worst place and a remedy.
    """

    wanted: float
    reached: float
    is_reached: bool
    worst: tuple[float, float, float] | None = None
    distance: float = float("inf")
    warnings: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON: None for what is not finite."""
        values = {
            "wanted": self.wanted,
            "reached": self.reached,
            "is_reached": self.is_reached,
            "worst": self.worst,
            "distance": self.distance,
            "warnings": list(self.warnings),
        }
        return {
            name: None if isinstance(value, float) and not np.isfinite(value) else value
            for name, value in values.items()
        }


def report_accuracy(arena: Arena) -> AccuracyReport:
    """Return whether an arena is as accurate as wanted; what its making has noted is taken from there."""
    notes, options = arena.provenance, arena.provenance.get("options", {})
    wanted = float(notes.get("accuracy", options.get("accuracy", np.inf)))
    reached = arena.quality.mean
    most = options.get("max_pieces", np.inf)
    is_reached = bool(notes.get("is_reached", reached <= wanted and arena.quality.num_pieces <= most))
    warnings = [str(warning) for warning in notes.get("warnings", [])]
    if is_reached:
        return AccuracyReport(wanted, reached, True, warnings=tuple(warnings))
    worst, distance = _find_worst(arena)
    warnings.append(
        f"contact is {_format(reached)} off in the mean; {_format(wanted)} was wanted; "
        f"worst at {_format_place(worst)}, {_format(distance)} off; {_find_remedy(arena, most)}"
    )
    return AccuracyReport(wanted, reached, False, worst, distance, tuple(warnings))


def _find_worst(arena: Arena) -> tuple[tuple[float, float, float] | None, float]:
    """Return the place of the surface that is farthest from contact, and its distance [m]."""
    noted = arena.provenance.get("worst")
    if noted:
        x, y, z = (float(value) for value in noted["place"])
        return (x, y, z), float(noted["distance"])
    if not arena.pieces and arena.height_field is None:
        return None, np.inf
    vertices = np.asarray(arena.surface.vertices, dtype=np.float64)
    points = sample_area(vertices, np.asarray(arena.surface.faces, dtype=np.int64), _NUM_POINTS)
    contact = arena.pieces if arena.height_field is None else arena.height_field
    distances = np.abs(find_offsets(points, contact))
    worst = int(np.argmax(distances))
    x, y, z = points[worst].tolist()
    return (x, y, z), float(distances[worst])


def _find_remedy(arena: Arena, most: float) -> str:
    """Return what a user can do."""
    remedies = []
    if 2 * arena.quality.num_pieces > most:
        remedies.append(f"raise max_pieces (now {most:.0f})")
    if arena.quality.uncovered > 0.01:
        remedies.append("crop the scan to where the robot drives")
    remedies.append("accept a coarser accuracy")
    if arena.kind != "hfield":
        remedies.append('or use kind "hfield" on open ground')
    return ", ".join(remedies)


def _format(distance: float) -> str:
    return f"{1000 * distance:.3g} mm" if distance < 1.0 else f"{distance:.3g} m"


def _format_place(place: tuple[float, float, float] | None) -> str:
    if place is None:
        return "every place"
    return "({:.2f}, {:.2f}, {:.2f})".format(*place)
