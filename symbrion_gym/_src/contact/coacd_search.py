"""coacd with finer and finer thresholds."""

from __future__ import annotations

import logging

import trimesh

from symbrion_gym._src.contact.acceptance import compute_miss
from symbrion_gym._src.contact.decomposition import decompose
from symbrion_gym._src.contact.kinds import Contact
from symbrion_gym._src.contact.options import DEPTH, ITERATIONS, MAX_FACES, NODES, RESOLUTION, THRESHOLDS
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.simplification import simplify_surface
from symbrion_gym._src.errors import ArenaError

_logger = logging.getLogger(__name__)


def decompose_solid(problem: ContactProblem, solid: trimesh.Trimesh) -> Contact:
    """Decompose a solid until what is wanted is reached, or finer pieces would be too many."""
    options = problem.options
    solid = simplify_surface(solid, MAX_FACES)
    best: Contact | None = None
    for threshold in THRESHOLDS:
        problem.progress(f"coacd at threshold {threshold}", 0.8)
        try:
            made = _attempt(problem, solid, threshold)
        except ArenaError as error:
            if best is None:
                raise
            _logger.info("coacd at threshold %g: %s", threshold, error)
            break
        if best is None or _find_miss(problem, made) < _find_miss(problem, best):
            best = made
        # A finer threshold gives twice as many.
        if 2 * len(made.pieces) > options.max_pieces or _find_miss(problem, made) <= 1.0:
            break
    assert best is not None
    return best


def _attempt(problem: ContactProblem, solid: trimesh.Trimesh, threshold: float) -> Contact:
    """Decompose a solid once."""
    pieces = decompose(
        solid,
        threshold,
        problem.options.seed,
        problem.deadline.left(),
        mcts_iterations=ITERATIONS,
        mcts_max_depth=DEPTH,
        mcts_nodes=NODES,
        resolution=RESOLUTION,
        max_convex_hull=-1,
        preprocess_mode="off",
    )
    return problem.measure(pieces, {"way": "coacd", "threshold": threshold})


def _find_miss(problem: ContactProblem, contact: Contact) -> float:
    return compute_miss(contact, problem.accuracy, problem.options.max_pieces)
