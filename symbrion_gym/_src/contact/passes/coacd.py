"""coacd: convex decomposition of what is a true solid, or of slabs united to one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reconstruction._src.surfaces.intersections import find_intersections
from symbrion_gym._src.contact.boxing import split_at_creases, turn_into_boxes
from symbrion_gym._src.contact.coacd_search import decompose_solid
from symbrion_gym._src.contact.crease_lines import clear_hidden_edges
from symbrion_gym._src.contact.kinds import Contact
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.seams import mend_pieces
from symbrion_gym._src.contact.slab_union import decompose_slabs, has_moved, restore_planes
from symbrion_gym._src.contact.slabs import make_slabs
from symbrion_gym._src.contact.terrain_planes import MAX_PARTS, MAX_SLABS, MAX_UNITED, is_smooth
from symbrion_gym._src.errors import ArenaError


class NoCandidate(Exception):
    """A pass has nothing to offer; its text says why."""


def decompose_united_slabs(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return coacd's pieces of the united slabs."""
    if best is None or best.notes["way"] != "slabs":
        return None
    if len(best.pieces) > MAX_UNITED:
        raise NoCandidate(f"{len(best.pieces)} slabs would take coacd too long")
    try:
        pieces = decompose_slabs(
            best.pieces,
            problem.terrain_planes[0],
            problem.top.area_faces,
            problem.options.seed,
            problem.deadline.left(),
        )
        if has_moved(pieces, best.pieces):
            raise NoCandidate("coacd's pieces move walls")
        pieces = restore_planes(pieces, best.pieces)
    except ArenaError as error:
        raise NoCandidate(str(error)) from error
    return problem.measure(pieces, {**best.notes, "way": "coacd of slabs"})


def decompose_body(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return coacd's pieces of a closed solid."""
    if problem.solid is None or (best is not None and best.notes["way"].endswith("slabs")):
        return None
    vertices, faces = np.asarray(problem.solid.vertices), np.asarray(problem.solid.faces)
    if len(find_intersections(vertices, faces)):
        raise NoCandidate("the solid runs through itself: coacd might never end")
    try:
        return decompose_solid(problem, problem.solid)
    except ArenaError as error:
        raise NoCandidate(str(error)) from error


def fit_slabs(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs beneath the planes of a terrain; None where it is no terrain, or too rough for planes."""
    if problem.shape != "terrain":
        return None
    options = problem.options
    planes, tolerance = problem.terrain_planes
    if not is_smooth(problem.top, planes):
        return None
    most = min(options.max_pieces, MAX_SLABS)
    top = problem.top
    _, pieces = make_slabs(
        top,
        problem.top_ground,
        planes,
        tolerance,
        most,
        options.thickness,
        problem.deadline.is_over,
    )
    if not pieces:
        return None
    notes = {"way": "slabs", "tolerance": tolerance, "planes": len(planes.normals), "noise": planes.noise}
    return problem.measure(pieces, notes)


def close_seams(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs, or coacd's pieces of them, with closed seams."""
    if best is None or not _is_of_slabs(problem, best):
        return None
    pieces = mend_pieces(best.pieces, problem.top_ground, problem.deadline.is_over)
    return problem.measure(pieces, best.notes)


def fit_boxes(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs, or coacd's pieces of them, cut at creases and turned into boxes."""
    if best is None or not _is_of_slabs(problem, best):
        return None
    most = min(problem.options.max_pieces, max(MAX_PARTS, len(best.pieces)))
    parts = split_at_creases(best.pieces, most)
    boxed = turn_into_boxes(parts, problem.top_ground, problem.deadline.is_over)
    cleared = clear_hidden_edges(boxed, problem.top_ground)
    return problem.measure(cleared, best.notes)


def _is_of_slabs(problem: ContactProblem, contact: Contact) -> bool:
    """Return whether these are few solids beneath a terrain; mending compares every one with all others."""
    return contact.notes["way"].endswith("slabs") and len(contact.pieces) <= MAX_UNITED


def stop_clock(problem: ContactProblem, contact: Contact) -> Contact:
    """Return contact geometry with the time that it has taken up to now."""
    return replace(contact, quality=replace(contact.quality, seconds=problem.deadline.elapsed))
