"""The quality of an arena as rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import symbrion_gym as sg

if TYPE_CHECKING:
    from symbrion_gym.arenas.accuracy import AccuracyReport


def make_quality_rows(arena: sg.Arena, report: AccuracyReport) -> list[list[object]]:
    """Return measure and value of what is known about the contact geometry of an arena."""
    quality, wanted_pieces = arena.quality, arena.provenance.get("options", {}).get("max_pieces")
    rows: list[tuple[str, str | None]] = [
        ("accuracy wanted", format_distance(report.wanted)),
        ("accuracy reached", f"{format_distance(report.reached)}{'' if report.is_reached else ' (missed)'}"),
        ("surface to contact: 95 %", format_distance(quality.p95)),
        ("surface to contact: largest", format_distance(quality.max)),
        ("surface without contact", format_share(quality.uncovered)),
        ("contact to surface: mean", format_distance(quality.protrusion_mean)),
        ("contact to surface: 95 %", format_distance(quality.protrusion_p95)),
        ("contact to surface: largest", format_distance(quality.protrusion_max)),
        ("beams that end at their reading: contact", format_share(quality.beams_contact)),
        ("beams that end at their reading: surface", format_share(quality.beams_surface)),
        ("free space seen that is solid", format_share(quality.free_space)),
        ("readings dropped by pre-processing", format_share(quality.dropped)),
        ("pieces", f"{quality.num_pieces}" + (f" of at most {wanted_pieces}" if wanted_pieces else "")),
        ("time to build", f"{quality.seconds:.1f} s"),
    ]
    return [[name, value] for name, value in rows if value is not None]


def format_distance(distance: float | None) -> str | None:
    """Return a distance [m] as text in millimeters, or in meters from 1 m on; None stays None."""
    if distance is None:
        return None
    return f"{1000 * distance:.3g} mm" if distance < 1.0 else f"{distance:.3g} m"


def format_share(share: float | None) -> str | None:
    """Return a share as text in percent; None stays None."""
    return None if share is None else f"{100 * share:.3g} %"
