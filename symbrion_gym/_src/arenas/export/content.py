"""What an export consists of, before any format: solids, surface, heights, and what is known about them."""

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull, QhullError

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.friction_map import cut_solid
from symbrion_gym._src.arenas.spec import ArenaGeometry, Solid, make_solids
from symbrion_gym._src.errors import ArenaError

FEWEST_VERTICES = 8
"""The least limit: that of a box. With fewer, most solids would become hundreds of tetrahedra."""
_TOLERANCE = 2e-4
"""How far the dropped vertices of a solid may stick out [m]: below the noise of any scanner. With more, fewer solids
are cut, and the contact moves further from what was measured."""
_MOST_CUTS = 6
"""How often a solid is halved; what then still has too many vertices is approximated from inside."""


def limit_vertices(
    solid: trimesh.Trimesh, most: int, cuts_left: int = _MOST_CUTS
) -> tuple[list[trimesh.Trimesh], float]:
    """Return convex solids of at most some vertices in place of one, and how far that sticks out of them [m]."""
    if len(solid.vertices) <= most:
        return [solid], 0.0
    hull = make_hull(np.asarray(solid.vertices, dtype=np.float64))
    if hull is None:  # thinner than rounding
        return [], 0.0
    corners = np.asarray(hull.vertices)
    if len(corners) <= most:
        return [hull], 0.0
    chosen, deviation = _choose_corners(corners, most)
    reduced = make_hull(corners[chosen])
    if reduced is not None and (deviation <= _TOLERANCE or cuts_left == 0):
        return [reduced], deviation
    axis = int(np.ptp(corners, axis=0).argmax())
    along = corners[:, axis]
    place = float(np.clip(np.median(along), *np.quantile([along.min(), along.max()], [0.25, 0.75])))
    halves = [half for half in cut_solid(hull, np.eye(3)[axis], place) if half is not None]
    limited = [limit_vertices(half, most, max(cuts_left - 1, 0)) for half in halves]
    return [part for parts, _ in limited for part in parts], max(each for _, each in limited)


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


class Content(NamedTuple):
    """An arena as the writers of the formats see it."""

    geometry: ArenaGeometry  # its pieces are the solids before any was cut
    solids: list[Solid]  # convex solids, for contact
    deviation: float  # how far an original piece sticks out of the solids, at most [m]


def make_content(geometry: ArenaGeometry, max_vertices: int | None) -> Content:
    """Return the content of an export, its solids of at most so many vertices, or without a limit."""
    if max_vertices is None:
        parts, deviation = list(geometry.pieces), 0.0
    elif max_vertices < FEWEST_VERTICES:
        raise ArenaError(
            f"max_vertices is {max_vertices}; {FEWEST_VERTICES} or more are needed, or None for no limit"
        )
    else:
        limited = [limit_vertices(piece, max_vertices) for piece in geometry.pieces]
        parts = [part for pieces, _ in limited for part in pieces]
        deviation = max((each for _, each in limited), default=0.0)
    digits = max(len(str(len(parts) - 1)), 3)
    return Content(geometry, make_solids(geometry._replace(pieces=parts), digits), deviation)
