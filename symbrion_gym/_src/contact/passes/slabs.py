"""Slabs: a terrain of few planes as few convex solids beneath them."""

from __future__ import annotations

from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.primitives import find_uncovered, make_boxes
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.slabs import make_slabs
from symbrion_gym._src.contact.terrain_planes import is_smooth


def fit_slabs(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs beneath the planes of a terrain; None where it is no terrain, or too rough for planes."""
    if problem.shape != "terrain":
        return None
    options, config = problem.options, problem.config
    planes, tolerance = problem.terrain_planes
    if not is_smooth(problem.top, planes, config.slab_pass):
        return None
    most = min(options.max_pieces, config.slab_pass.max_slabs)
    top = problem.top
    _, pieces = make_slabs(
        top,
        problem.top_ground,
        planes,
        tolerance,
        most,
        options.thickness,
        problem.deadline.is_over,
        config.slabs,
    )
    if options.kind == "primitives":
        boxes = make_boxes(top, problem.top_ground, planes, tolerance, config.primitives)
        pieces = boxes + find_uncovered(pieces, boxes, tolerance, config.primitives)
    if not pieces:
        return None
    notes = {"way": "slabs", "tolerance": tolerance, "planes": len(planes.normals), "noise": planes.noise}
    return problem.measure(pieces, notes)
