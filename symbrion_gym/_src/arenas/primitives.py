"""Primitives of an arena: what stands in for triangles, in rays, in contact and in its folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import trimesh
from jaxtyping import Bool

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.typed_json import JsonError, as_type
from reconstruction._src.surfaces.primitives.config import PrimitivesConfig
from reconstruction._src.surfaces.primitives.find import Primitives, find_primitives
from reconstruction._src.surfaces.primitives.primitive import Primitive
from symbrion_gym._src.arenas.beam_cost import pays
from symbrion_gym._src.errors import ArenaError

_FAR = 1e6
"""Farther out is no arena [m]."""
_ROTATION = 1e-6
"""Largest deviation of axes from a rotation."""


@dataclass(frozen=True)
class _Row:
    """A primitive in `arena.json`."""

    kind: Literal["plane", "box", "sphere", "cylinder"]
    center: tuple[float, float, float]
    axes: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    half_sizes: tuple[float, float, float]

    def __post_init__(self) -> None:
        axes, sizes = np.array(self.axes), np.array(self.half_sizes)
        count = {"sphere": 1, "cylinder": 2}.get(self.kind, 3)
        if not (sizes[:count] > 0).all() or not (np.abs([*self.center, *sizes]) < _FAR).all():
            raise ArenaError(
                f"a {self.kind} has sizes {self.half_sizes} at {self.center}; lengths above 0 are needed"
            )
        if not np.allclose(axes @ axes.T, np.eye(3), atol=_ROTATION) or np.linalg.det(axes) < 0:
            raise ArenaError(f"the axes of a {self.kind} are {self.axes}; a rotation is needed")


@dataclass(frozen=True)
class _Table:
    """All primitives in `arena.json`."""

    tolerance: float
    shapes: tuple[_Row, ...]

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < _FAR:
            raise ArenaError(f"the tolerance of primitives is {self.tolerance}; a length above 0 is needed")


def find_arena_primitives(surface: trimesh.Trimesh, seed: int) -> Primitives:
    """Return the primitives of an arena's surface; no rectangles where they would not make beams cheaper."""
    try:
        found = find_primitives(surface, seed=seed)
    except ReconstructionError as error:
        raise ArenaError(str(error)) from error
    return found if pays(surface, found) else found._replace(shapes=find_solids(found))


def primitives_to_dict(primitives: Primitives) -> dict[str, Any]:
    """Return primitives for JSON."""
    return {
        "tolerance": primitives.tolerance,
        "shapes": [
            {
                "kind": one.kind,
                "center": one.center.tolist(),
                "axes": one.axes.tolist(),
                "half_sizes": one.half_sizes.tolist(),
            }
            for one in primitives.shapes
        ],
    }


def primitives_from_dict(content: dict[str, Any]) -> Primitives:
    """Return what `primitives_to_dict` was made of."""
    try:
        table = as_type(content, _Table, "primitives")
    except JsonError as error:
        raise ArenaError(str(error)) from error
    shapes = [
        Primitive(row.kind, np.array(row.center), np.array(row.axes), np.array(row.half_sizes))
        for row in table.shapes
    ]
    return Primitives(shapes, table.tolerance, PrimitivesConfig())


def find_solids(primitives: Primitives | None) -> list[Primitive]:
    """Return the boxes, spheres and cylinders: each is a contact piece; they are the last pieces of an arena."""
    return [] if primitives is None else [one for one in primitives.shapes if one.is_solid]


def take_solids_out(surface: trimesh.Trimesh, primitives: Primitives) -> Bool[np.ndarray, " F"]:
    """Return which faces of a surface no solid primitive replaces."""
    corners = np.asarray(surface.triangles)
    is_left = np.ones(len(corners), dtype=bool)
    for solid in find_solids(primitives):
        is_left &= ~solid.find_replaced(corners, primitives.tolerance)
    return is_left
