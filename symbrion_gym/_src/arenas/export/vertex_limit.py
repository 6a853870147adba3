"""Convex solids with few vertices, for engines with a limit: a solid with more is cut into several.

PhysX collides hulls of at most 64 vertices on a GPU, and MJX is fast up to about 20. A cut changes nothing of the
shape: the halves of a convex solid are convex and share the cut.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull, QhullError

from reconstruction._src.geometry.hulls import make_hull

FEWEST_VERTICES = 8
"""The least limit: that of a box. With fewer, most solids would become hundreds of tetrahedra."""
_TOLERANCE = 2e-4
"""How far the dropped vertices of a solid may stick out [m]: below the noise of any scanner. With more, fewer solids
are cut, and the contact moves further from what was measured."""
_MOST_CUTS = 6
"""How often a solid is halved; what then still has too many vertices is approximated from inside."""


class LimitedSolid(NamedTuple):
    """Solids in place of one.

    Attributes:
        parts: convex solids, all within the limit.
        deviation: how far the solid sticks out of them, at most [m].
    """

    parts: list[trimesh.Trimesh]
    deviation: float


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
