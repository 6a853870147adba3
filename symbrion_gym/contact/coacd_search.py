"""coacd with finer and finer thresholds."""

from __future__ import annotations

import logging
from typing import Any

import trimesh

from reconstruction.errors import ReconstructionError
from reconstruction.geometry.decimation import simplify
from symbrion_gym.contact.contact import Contact, select_best
from symbrion_gym.contact.decomposition import decompose
from symbrion_gym.contact.job import ContactJob
from symbrion_gym.errors import ArenaError

_logger = logging.getLogger(__name__)


def decompose_solid(job: ContactJob, solid: trimesh.Trimesh, shape: str) -> Contact:
    """Decompose a solid until the accuracy is met or pieces or time run out.

    A solid that coacd cannot end with (one that folds through itself) is tried again as coacd's own remeshing has it.

    Args:
        job: what is wanted.
        solid: closed mesh.
        shape: what it was made of, for the notes.

    Raises:
        ArenaError: coacd crashed, ran out of time or found nothing.
    """
    search, max_pieces = job.tuning.search, job.options.max_pieces
    if len(solid.faces) > search.max_faces:
        solid = _simplify(solid, search.max_faces)
    made: list[Contact] = []
    for threshold in search.thresholds:
        if made and job.budget.is_exceeded(search.finer_until):
            break
        try:
            found = _attempt(job, solid, shape, threshold)
            made.append(found)
            if len(found.pieces) > max_pieces and not job.budget.is_exceeded(search.fewer_until):
                made.append(_attempt(job, solid, shape, threshold, max_convex_hull=max_pieces))
        except ArenaError as error:
            _logger.info("coacd at threshold %g: %s", threshold, error)
            break
        # A finer threshold gives twice as many.
        if 2 * len(found.pieces) > max_pieces or found.quality.mean <= job.options.accuracy:
            break
    if not made:
        solid = _simplify(solid, int(search.last_faces * search.max_faces))
        remeshed = {"preprocess_mode": "on", "max_convex_hull": max_pieces}
        made.append(_attempt(job, solid, shape, search.last_threshold, share=1.0, **remeshed))
    return job.stop(select_best(made, max_pieces))


def _attempt(
    job: ContactJob,
    solid: trimesh.Trimesh,
    shape: str,
    threshold: float,
    share: float | None = None,
    **more: Any,
) -> Contact:
    """Decompose a solid once, within a share of the time limit."""
    search, limit = job.tuning.search, job.options.time_limit
    share = search.share if share is None else share
    begin = 0.6 if shape == "terrain" else 0.4  # of the progress bar
    job.progress(f"coacd at threshold {threshold}", min(begin + 0.3 * job.budget.spent / limit, 0.9))
    options = {
        "mcts_iterations": search.iterations,
        "mcts_max_depth": search.depth,
        "mcts_nodes": search.nodes,
        "resolution": search.resolution,
        "max_convex_hull": -1,
        "preprocess_mode": "off",
        "preprocess_resolution": search.remeshing,
    }
    limits = max((1.0 + share) / 2 * job.budget.left(), search.least_time), share * limit
    pieces = decompose(solid, threshold, job.options.seed, *limits, **{**options, **more})
    return job.measure(pieces, {"shape": shape, "way": "coacd", "threshold": threshold})


def _simplify(solid: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    """Return a solid with about `count` faces.

    Raises:
        ArenaError: no face with an area is left.
    """
    try:
        return trimesh.Trimesh(*simplify(solid.vertices, solid.faces, count), process=False)
    except ReconstructionError as error:
        raise ArenaError(str(error)) from error
