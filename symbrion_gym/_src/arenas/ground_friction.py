"""Which friction the ground of an arena has: given, of a course, felt by robots, or assumed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch

if TYPE_CHECKING:
    from reconstruction._src.slip.patches import EstimatedPatch, FrictionEstimate

ASSUMED_FRICTION = 0.7
"""Rubber tracks on a hard floor, about; a scan does not show it."""


class GroundFriction(NamedTuple):
    """The friction of a ground.

    Attributes:
        friction: sliding friction outside of all patches.
        source: see `Arena.friction_source`.
        friction_map: patches with another friction, or None.
    """

    friction: float
    source: str
    friction_map: FrictionMap | None


def choose_friction(
    friction: float | None,
    friction_map: FrictionMap | None,
    course: Course | StairsCourse | None,
    felt: FrictionEstimate | None,
) -> GroundFriction:
    """Return the friction of an arena: what is given goes before the course, this before what robots felt."""
    if friction is not None:
        return GroundFriction(friction, "given", friction_map)
    if course is not None:
        return GroundFriction(course.friction, "exact", friction_map or course.friction_map)
    if felt is None:
        return GroundFriction(ASSUMED_FRICTION, "assumed", friction_map)
    return GroundFriction(
        _clip(felt.patches[0].friction), "estimated", friction_map or make_friction_map(felt)
    )


def make_friction_map(felt: FrictionEstimate) -> FrictionMap:
    """Return what robots felt as a map: the largest patch is the ground outside of the others."""
    patches = tuple(_make_patch(patch) for patch in felt.patches[1:] if len(patch.rectangles))
    return FrictionMap(patches, felt.patches[0].half_width)


def _make_patch(patch: EstimatedPatch) -> FrictionPatch:
    outlines = tuple(((x0, y0), (x1, y0), (x1, y1), (x0, y1)) for x0, y0, x1, y1 in patch.rectangles.tolist())
    return FrictionPatch(_clip(patch.friction), outlines, patch.half_width)


def _clip(friction: float) -> float:
    return float(np.clip(friction, *FRICTION_LIMITS))
