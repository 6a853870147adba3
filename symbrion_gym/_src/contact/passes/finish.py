"""Finishing passes for solids beneath a terrain: seams closed, creases cut, boxes where they fit."""

from __future__ import annotations

from dataclasses import replace

from symbrion_gym._src.contact.boxing import split_at_creases, turn_into_boxes
from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.hidden_edges import clear_hidden_edges
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.seams import mend_pieces


def close_seams(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs, or coacd's pieces of them, with closed seams."""
    if best is None or not _is_of_slabs(problem, best):
        return None
    pieces = mend_pieces(best.pieces, problem.top_ground, problem.deadline.is_over, problem.config.seams)
    return problem.measure(pieces, best.notes)


def fit_boxes(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs, or coacd's pieces of them, cut at creases and turned into boxes."""
    if best is None or not _is_of_slabs(problem, best):
        return None
    config = problem.config
    most = min(problem.options.max_pieces, max(config.slab_pass.max_parts, len(best.pieces)))
    parts = split_at_creases(best.pieces, most, config.boxes)
    boxed = turn_into_boxes(parts, problem.top_ground, config.boxes, problem.deadline.is_over)
    cleared = clear_hidden_edges(boxed, problem.top_ground, config.edges)
    return problem.measure(cleared, best.notes)


def _is_of_slabs(problem: ContactProblem, contact: Contact) -> bool:
    """Return whether these are few solids beneath a terrain; mending compares every one with all others."""
    return (
        contact.notes["way"].endswith("slabs") and len(contact.pieces) <= problem.config.slab_pass.max_united
    )


def stop_clock(problem: ContactProblem, contact: Contact) -> Contact:
    """Return contact geometry with the time that it has taken up to now."""
    return replace(contact, quality=replace(contact.quality, seconds=problem.deadline.elapsed))
