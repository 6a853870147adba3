"""From a repaired surface to contact geometry: a list of passes, and one rule that accepts their candidates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import format_distance
from symbrion_gym._src.contact.acceptance import compute_miss, find_fault
from symbrion_gym._src.contact.deadline import Deadline
from symbrion_gym._src.contact.kinds import Contact, make_height_field
from symbrion_gym._src.contact.options import ContactOptions
from symbrion_gym._src.contact.passes.coacd import (
    NoCandidate,
    close_seams,
    decompose_body,
    decompose_united_slabs,
    fit_boxes,
    fit_slabs,
    stop_clock,
)
from symbrion_gym._src.contact.passes.patches import (
    fit_flat_patches,
    fit_height_field,
    fit_patches,
    make_prisms,
    measure_heights,
)
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.solid import Shape
from symbrion_gym._src.errors import ArenaError

Pass = Callable[[ContactProblem, Contact | None], Contact | None]
"""From the problem and the best so far to a candidate; None where the pass does not apply."""

_SURFACE_PASSES = (fit_slabs, fit_flat_patches, fit_patches)
_LATER_PASSES = (decompose_united_slabs, decompose_body, close_seams, fit_boxes)
PASSES: dict[str, tuple[Pass, ...]] = {
    "auto": (*_SURFACE_PASSES, fit_height_field, *_LATER_PASSES),
    "convex": (*_SURFACE_PASSES, *_LATER_PASSES),
    "prisms": (make_prisms,),
    "mixed": (*_SURFACE_PASSES, *_LATER_PASSES),
}
"""Passes of each choice of contact geometry that has pieces, in order."""


def make_contact(
    surface: trimesh.Trimesh,
    options: ContactOptions,
    accuracy: float,
    progress: Progress = silent,
    is_two_sided: Bool[np.ndarray, " F"] | None = None,
    passes: tuple[Pass, ...] | None = None,
    known_shape: Shape | None = None,
) -> Contact:
    """Make contact geometry of a repaired surface."""
    deadline = Deadline(options.time_limit)
    problem = ContactProblem(surface, options, accuracy, deadline, progress, is_two_sided, known_shape)
    if options.kind == "hfield":
        best = _make_height_field(problem)
    else:
        best = run_passes(problem, PASSES[options.kind] if passes is None else passes)
    return _add_notes(problem, stop_clock(problem, best))


def run_passes(problem: ContactProblem, passes: tuple[Pass, ...]) -> Contact:
    """Return the best candidate, with a note on each pass."""
    best, record = None, []
    for number, make in enumerate(passes):
        if best is not None and problem.deadline.is_over():
            break
        name = make.__name__.replace("_", " ")
        problem.progress(name, 0.05 + 0.9 * number / len(passes))
        try:
            candidate = make(problem, best)
        except NoCandidate as reason:
            record.append({"pass": name, "result": str(reason)})
            continue
        if candidate is None:
            continue
        options = problem.options
        fault = find_fault(best, candidate, problem.accuracy, options.max_pieces)
        quality = candidate.quality
        figures = {"pieces": len(candidate.pieces), "mean": quality.mean, "uncovered": quality.uncovered}
        record.append({"pass": name, **figures, "result": f"refused: {fault}" if fault else "accepted"})
        best = best if fault else candidate
    if best is None:
        raise ArenaError(
            "no contact geometry can be made of this surface: it has no face that a robot could touch"
        )
    return replace(best, notes={**best.notes, "passes": record})


def _make_height_field(problem: ContactProblem) -> Contact:
    """Return the heights of a terrain on a grid."""
    heights = make_height_field(problem.surface, problem.ground)
    return measure_heights(problem, heights, {"way": "height field"})


def _add_notes(problem: ContactProblem, contact: Contact) -> Contact:
    """Return contact geometry with what a user should know of it."""
    options, accuracy = problem.options, problem.accuracy
    miss = compute_miss(contact, accuracy, options.max_pieces)
    notes: dict[str, Any] = {"accuracy": accuracy, "shape": problem.shape, "is_reached": miss <= 1.0}
    place, distance = _find_worst(problem, contact)
    notes["worst"] = {"place": place, "distance": distance}
    warnings = []
    if problem.deadline.has_cut_short:
        notes["was_cut_short"] = True
        warnings.append(
            f"building ended at the time limit of {options.time_limit:g} s with the best so far; allow more time"
        )
    if miss > 1.0:
        warnings.append(_describe_miss(problem, contact, place, distance))
    return replace(contact, notes={**contact.notes, **notes, "warnings": warnings})


def _find_worst(problem: ContactProblem, contact: Contact) -> tuple[list[float], float]:
    distance = problem.distance
    if contact.height_field is not None:
        gaps = distance.compute_gaps_of_sheet(contact.height_field.as_mesh())
    else:
        gaps = distance.compute_gaps(contact.pieces)
    place, worst = gaps.find_worst()
    return [round(float(x), 3) for x in place], worst


def _describe_miss(problem: ContactProblem, contact: Contact, place: list[float], distance: float) -> str:
    """Return one line: what is missed, where, and what helps."""
    quality, count = contact.quality, len(contact.pieces)
    remedy = f"allow more pieces (max_pieces is {problem.options.max_pieces})"
    if 2 * count < problem.options.max_pieces:
        remedy = "ask for less accuracy"
    if problem.options.kind in ("hfield", "prisms"):
        remedy = "take kind 'convex'"
    elif problem.shape == "terrain":
        remedy += ", or take kind 'hfield'"
    where = ", ".join(f"{x:.2f}" for x in place)
    missed = f"accuracy {format_distance(problem.accuracy)} was missed"
    if count > problem.options.max_pieces:
        missed = f"max_pieces {problem.options.max_pieces} is exceeded"
    return (
        f"{missed}: {count} pieces are {format_distance(quality.mean)} off in the mean, "
        f"{format_distance(quality.p95)} at the 95th percentile, {quality.uncovered:.1%} of the surface has no contact "
        f"within 5 cm; worst {format_distance(distance)} at ({where}); {remedy}"
    )
