"""What a beam costs: the expected number of boxes of MuJoCo's trees that it enters."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from reconstruction._src.surfaces.primitives.find import Primitives
from symbrion_gym._src.arenas.mixed_surface import add_mixed_surface

MOST_COST = 0.67
"""Primitives are used where beams cost at most this share of what they cost on the triangles alone. Time follows the
cost within a third where most beams hit something, as in rooms and on courses; beyond two thirds nothing is sure to be
saved: a table that stands alone costs 0.70 by this measure, and 1.7 in time."""


def find_beam_cost(surface: trimesh.Trimesh, primitives: Primitives) -> float:
    """Return how many boxes of MuJoCo's trees a random beam through the surface's box enters, in the mean.

    A count, no time: the same on every machine.

    References:
        MacDonald and Booth (1990), Heuristics for ray tracing using space subdivision, The Visual Computer 6, section
        3: a box within another is met with the ratio of their areas.
    """
    spec = mujoco.MjSpec()
    add_mixed_surface(spec, surface, primitives, {})
    model = spec.compile()
    area = _measure_sides(model.bvh_aabb.reshape(-1, 6)[:, 3:])
    whole = _measure_sides(np.asarray(surface.extents)[None] / 2)[0]
    cost = 0.0
    for start, count in zip(model.mesh_bvhadr, model.mesh_bvhnum, strict=True):
        cost += float(area[start : start + count].sum() / whole)
    return cost


def pays(surface: trimesh.Trimesh, primitives: Primitives) -> bool:
    """Return whether beams on primitives and the rest cost clearly less than on the triangles alone."""
    if not any(one.kind == "plane" for one in primitives.shapes):
        return True
    none = primitives._replace(shapes=[])
    return find_beam_cost(surface, primitives) <= MOST_COST * find_beam_cost(surface, none)


def _measure_sides(half: np.ndarray) -> np.ndarray:
    """Return half the area of boxes of some half sizes [m²], but for a factor."""
    return half[:, 0] * half[:, 1] + half[:, 1] * half[:, 2] + half[:, 2] * half[:, 0]
