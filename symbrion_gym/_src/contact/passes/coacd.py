"""coacd: convex decomposition of what is a true solid, or of slabs united to one."""

from __future__ import annotations

import numpy as np

from reconstruction._src.surfaces.intersections import find_intersections
from symbrion_gym._src.contact.coacd_search import decompose_solid
from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.slab_union import decompose_slabs, has_moved, restore_planes
from symbrion_gym._src.errors import ArenaError


class NoCandidate(Exception):
    """A pass has nothing to offer; its text says why."""


def decompose_united_slabs(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return coacd's pieces of the united slabs."""
    if best is None or best.notes["way"] != "slabs":
        return None
    config = problem.config
    if len(best.pieces) > config.slab_pass.max_united:
        raise NoCandidate(f"{len(best.pieces)} slabs would take coacd too long")
    try:
        pieces = decompose_slabs(
            best.pieces,
            problem.terrain_planes[0],
            problem.top.area_faces,
            problem.options.seed,
            problem.deadline.left(),
            config.union,
        )
        if has_moved(pieces, best.pieces, config.union):
            raise NoCandidate("coacd's pieces move walls")
        pieces = restore_planes(pieces, best.pieces, config.union)
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
