"""What an export consists of, before any format: solids, surface, heights, and what is known about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull, QhullError

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import Box, find_box
from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.friction_map import FrictionMap
from symbrion_gym._src.arenas.placed_objects import PlacedObject
from symbrion_gym._src.arenas.spec import ArenaGeometry, compute_patch_frictions
from symbrion_gym._src.arenas.texture import SurfaceTexture
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError

FEWEST_VERTICES = 8
"""The least limit: that of a box. With fewer, most solids would become hundreds of tetrahedra."""
_TOLERANCE = 2e-4
"""How far the dropped vertices of a solid may stick out [m]: below the noise of any scanner. With more, fewer solids
are cut, and the contact moves further from what was measured."""
_MOST_CUTS = 6
"""How often a solid is halved; what then still has too many vertices is approximated from inside."""


class LimitedSolid(NamedTuple):
    """Solids in place of one."""

    parts: list[trimesh.Trimesh]  # convex solids, all within the limit
    deviation: float  # how far the solid sticks out of them, at most [m]


def limit_vertices(solid: trimesh.Trimesh, most: int) -> LimitedSolid:
    """Return a convex solid as one or more with at most a number of vertices each."""
    if len(solid.vertices) <= most:
        return LimitedSolid([solid], 0.0)
    return _limit(np.asarray(solid.vertices, dtype=np.float64), most, _MOST_CUTS)


def _limit(points: Float[np.ndarray, "N 3"], most: int, cuts_left: int) -> LimitedSolid:
    hull = make_hull(points)
    if hull is None:  # a sliver of a cut, thinner than rounding
        return LimitedSolid([], 0.0)
    corners = np.asarray(hull.vertices)
    if len(corners) <= most:
        return LimitedSolid([hull], 0.0)
    chosen, deviation = _choose_corners(corners, most)
    reduced = make_hull(corners[chosen])
    if reduced is not None and (deviation <= _TOLERANCE or cuts_left == 0):
        return LimitedSolid([reduced], deviation)
    halves = [_limit(half, most, max(cuts_left - 1, 0)) for half in _halve(hull)]
    return LimitedSolid([part for half in halves for part in half.parts], max(h.deviation for h in halves))


def _choose_corners(corners: Float[np.ndarray, "N 3"], most: int) -> tuple[Int[np.ndarray, " M"], float]:
    """Choose corners greedily, always the one farthest outside of the hull of those chosen before."""
    chosen = list(dict.fromkeys(int(index) for axis in corners.T for index in (axis.argmin(), axis.argmax())))
    for index in range(len(corners)):  # more corners where these lie in a plane
        if len(chosen) >= 4 and np.linalg.matrix_rank(corners[chosen] - corners[chosen[0]]) == 3:
            break
        if index not in chosen:
            chosen.append(index)
    outside = np.full(len(corners), np.inf)
    while len(chosen) <= most:
        try:
            planes = ConvexHull(corners[chosen]).equations
        except QhullError:
            break
        outside = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        farthest = int(outside.argmax())
        if len(chosen) == most or outside[farthest] <= 0.0 or farthest in chosen:
            break
        chosen.append(farthest)
    return np.array(chosen[:most]), max(float(outside.max()), 0.0)


def _halve(hull: trimesh.Trimesh) -> tuple[Float[np.ndarray, "A 3"], Float[np.ndarray, "B 3"]]:
    """Return the corners of both halves of a solid, cut across the longest side of its bounding box."""
    corners = np.asarray(hull.vertices)
    axis = int(np.ptp(corners, axis=0).argmax())
    along = corners[:, axis]
    place = float(np.clip(np.median(along), *np.quantile([along.min(), along.max()], [0.25, 0.75])))
    begin, end = corners[hull.edges_unique[:, 0]], corners[hull.edges_unique[:, 1]]
    crosses = (begin[:, axis] - place) * (end[:, axis] - place) < 0
    begin, end = begin[crosses], end[crosses]
    share = (place - begin[:, axis]) / (end[:, axis] - begin[:, axis])
    section = begin + share[:, None] * (end - begin)
    return np.concatenate([corners[along <= place], section]), np.concatenate(
        [corners[along >= place], section]
    )


_HEIGHT_SPACING = 0.02
"""Spacing of the grid of heights [m]: about that of a scan indoors; half of it takes four times the memory."""
_MOST_HEIGHTS = 400_000  # Cells of that grid; it is wider where it would have more


@dataclass(frozen=True)
class Solid:
    """A convex solid for contact."""

    name: str  # unique, a valid name in all formats
    mesh: trimesh.Trimesh  # its corners and triangles
    box: Box | None  # the box that it is, where it is one: engines collide boxes faster
    friction: float | None = None  # sliding friction of the patch that it lies in; None outside of all


@dataclass(frozen=True)
class Content:
    """An arena as the writers of the formats see it."""

    name: str  # name of the arena
    solids: list[Solid]  # convex solids, for contact
    surface: trimesh.Trimesh  # the exact surface, for rays and pictures
    height_field: HeightField | None  # in place of solids, for the kind "hfield"
    friction: float  # sliding friction of the ground
    offset: tuple[float, float, float]  # what was subtracted from the coordinates of the scan [m]
    max_vertices: int | None  # the limit of the vertices of a solid; None without
    deviation: float  # how far an original piece sticks out of the solids, at most [m]
    num_pieces: int  # contact pieces of the arena, before any was cut
    quality: dict[str, Any]  # accuracy of the contact geometry, as `ArenaQuality.as_dict` returned it
    provenance: dict[str, Any]  # what the arena was made of
    friction_map: FrictionMap | None = None  # patches with another friction; None for one friction for all
    texture: SurfaceTexture | None = None  # colors of the surface; None where they are unknown
    objects: tuple[PlacedObject, ...] = ()  # known objects in it


def make_content(
    geometry: ArenaGeometry, max_vertices: int | None, friction_map: FrictionMap | None = None, **about: Any
) -> Content:
    """Return the content of an export."""
    if max_vertices is not None and max_vertices < FEWEST_VERTICES:
        raise ArenaError(
            f"max_vertices is {max_vertices}; {FEWEST_VERTICES} or more are needed, or None for no limit"
        )
    parts: list[trimesh.Trimesh] = []
    deviation = 0.0
    for piece in geometry.pieces:
        limited = None if max_vertices is None else limit_vertices(piece, max_vertices)
        parts += [piece] if limited is None else limited.parts
        deviation = max(deviation, 0.0 if limited is None else limited.deviation)
    digits = max(len(str(len(parts) - 1)), 3)
    frictions = compute_patch_frictions(parts, friction_map)
    return Content(
        solids=[
            Solid(f"arena_piece_{i:0{digits}d}", part, find_box(part), frictions[i])
            for i, part in enumerate(parts)
        ],
        friction_map=friction_map,
        surface=geometry.surface,
        height_field=geometry.height_field,
        max_vertices=max_vertices,
        deviation=deviation,
        num_pieces=len(geometry.pieces),
        texture=geometry.texture,
        **about,
    )


def sample_heights(surface: trimesh.Trimesh) -> dict[str, Float[np.ndarray, " ..."]]:
    """Return the heights of a surface as seen from above, on a grid."""
    low, high = np.asarray(surface.bounds, dtype=np.float64)[:, :2]
    spacing = max(_HEIGHT_SPACING, float(np.sqrt(np.prod(high - low) / _MOST_HEIGHTS)))
    columns, rows = (max(int(np.ceil(extent / spacing)) + 1, 2) for extent in high - low)
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    return {"heights": Elevation(surface).height(x, y).astype(np.float32), "low": low, "high": high}
