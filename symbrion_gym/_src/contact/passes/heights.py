"""A height field for rough ground that has nothing above it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from symbrion_gym._src.contact.acceptance import AcceptanceConfig
from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.kinds import FieldConfig, HeightField, make_height_field
from symbrion_gym._src.contact.passes.coacd import NoCandidate
from symbrion_gym._src.contact.problem import ContactProblem


def fit_height_field(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return a height field of open ground that has many patches; None where it has few, or is no terrain."""
    if best is None or problem.shape != "terrain" or problem.surface.is_watertight:
        return None
    config, extents = problem.config, problem.surface.extents
    is_sparse = len(best.pieces) < config.heights.least_density * float(extents[0] * extents[1])
    if is_sparse or best.notes["way"].endswith("slabs"):
        return None
    field = _find_coarsest_field(problem, config.acceptance, config.heights)
    if field is None:
        raise NoCandidate("no grid follows the ground closely enough, or too much of it is not known")
    return field


def measure_heights(problem: ContactProblem, heights: HeightField, notes: dict) -> Contact:
    """Return a height field with its distances from the surface."""
    gaps = problem.distance.find_gaps_of_sheet(heights.as_mesh())
    quality = problem.distance.summarize(gaps, 0, problem.deadline.elapsed)
    return Contact([], quality, heights, notes)


def _find_coarsest_field(
    problem: ContactProblem, acceptance: AcceptanceConfig, config: FieldConfig
) -> Contact | None:
    """Return the coarsest height field that follows the ground closely enough; None where none does."""
    spacing = config.coarsest
    while spacing >= config.finest and not problem.deadline.is_over():
        heights = _sample_heights(problem, spacing, config)
        if heights is None:
            return None
        made = measure_heights(problem, heights, {"way": "height field", "spacing": spacing})
        mean, p95 = made.quality.mean / problem.accuracy, made.quality.p95 / problem.accuracy
        if mean <= config.share and p95 <= config.share * acceptance.p95:
            return made
        spacing *= config.shrink
    return None


def _sample_heights(problem: ContactProblem, spacing: float, config: FieldConfig) -> HeightField | None:
    """Return the heights on a grid, those off the ground as at the nearest place on it; None where many are off it.

    The outer rows do not count: the rim of a scan is ragged.
    """
    heights = make_height_field(problem.surface, problem.ground, spacing)
    rows, columns = heights.heights.shape
    x, y = np.meshgrid(
        *(np.linspace(heights.low[i], heights.high[i], n) for i, n in ((0, columns), (1, rows)))
    )
    is_known = np.isfinite(problem.ground.height(x, y))
    if min(rows, columns) < 3 or is_known[1:-1, 1:-1].mean() < config.known:
        return None
    nearest = np.asarray(distance_transform_edt(~is_known, return_distances=False, return_indices=True))
    return heights._replace(heights=heights.heights[tuple(nearest)])
