"""Rows of tables: what is known about an arena and about a surface."""

from __future__ import annotations

import math
from typing import Any

import reconstruction as rc
import symbrion_gym as sg
from reconstruction._src.base.range_checks import format_distance, format_share


def describe_accuracy(arena: sg.Arena) -> dict[str, Any]:
    """Return the accuracy of an arena, wanted and reached, as its making has noted it; None for what is not finite."""
    notes, reached = arena.provenance, arena.quality.mean
    return {
        "wanted": notes["accuracy"],
        "reached": reached if math.isfinite(reached) else None,
        "is_reached": notes["is_reached"],
        "worst": notes["worst"]["place"],
        "distance": notes["worst"]["distance"],
        "warnings": notes["warnings"],
    }


def make_quality_rows(arena: sg.Arena) -> list[list[object]]:
    """Return measure and value of what is known about the contact geometry of an arena."""
    quality, wanted_pieces = arena.quality, arena.provenance.get("options", {}).get("max_pieces")
    pieces = f"{quality.num_pieces}" + (f" of at most {wanted_pieces}" if wanted_pieces else "")
    rows: list[tuple[str, str | None]] = [
        ("accuracy wanted", format_distance(arena.provenance["accuracy"])),
        (
            "accuracy reached",
            format_distance(quality.mean) + ("" if arena.provenance["is_reached"] else " (missed)"),
        ),
        ("surface to contact: 95 %", _distance(quality.p95)),
        ("surface to contact: largest", _distance(quality.max)),
        ("surface without contact", _share(quality.uncovered)),
        ("contact to surface: mean", _distance(quality.protrusion_mean)),
        ("contact to surface: 95 %", _distance(quality.protrusion_p95)),
        ("contact to surface: largest", _distance(quality.protrusion_max)),
        ("beams that end at their reading: contact", _share(quality.beams_contact)),
        ("beams that end at their reading: surface", _share(quality.beams_surface)),
        ("free space seen that is solid", _share(quality.free_space)),
        ("readings dropped by pre-processing", _share(quality.dropped)),
        ("pieces", pieces if arena.height_field is None else "none: a height field"),
        ("time to build", f"{quality.seconds:.1f} s"),
    ]
    return [[name, value] for name, value in rows if value is not None]


def make_surface_rows(quality: rc.Quality) -> list[list[object]]:
    """Return measure and value of what is known about a reconstructed surface."""
    topology = quality.topology
    rows: list[list[object]] = [
        ["vertices, faces", f"{topology.num_vertices}, {topology.num_faces}"],
        ["area", f"{quality.area:.4g} m²"],
        ["parts", topology.components],
        ["boundary loops", topology.boundary_loops],
        [
            "non manifold edges, pinched vertices",
            f"{topology.non_manifold_edges}, {topology.pinched_vertices}",
        ],
        ["self intersections, folds", f"{quality.self_intersections}, {quality.folds}"],
        ["smallest angle of a face: mean", f"{math.degrees(quality.min_angle):.1f}°"],
        ["faces with an angle below 10°", format_share(quality.slivers)],
    ]
    for name, distances in (
        ("cloud to mesh", quality.cloud_to_mesh),
        ("truth to mesh", quality.truth_to_mesh),
        ("mesh to truth", quality.mesh_to_truth),
    ):
        if distances is not None:
            values = (distances.mean, distances.p95, distances.max)
            rows.append([f"{name}: mean, p95, max", ", ".join(format_distance(value) for value in values)])
    return rows


def _distance(distance: float | None) -> str | None:
    return None if distance is None else format_distance(distance)


def _share(share: float | None) -> str | None:
    return None if share is None else format_share(share)
