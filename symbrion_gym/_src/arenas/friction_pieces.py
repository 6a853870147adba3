"""Contact pieces cut where the friction changes: a convex piece cut by a plane leaves two convex pieces.

Both sides of a cut keep the planes of the piece, so the ground stays as flat as it was.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.hulls import make_hull
from symbrion_gym._src.arenas.friction_map import FrictionMap, Outline

SLIVER = 1e-3
"""What reaches less than this across an outline is not cut off [m]: robots do not feel it, and MuJoCo compiles nothing
much thinner."""


def split_pieces(pieces: list[trimesh.Trimesh], friction_map: FrictionMap) -> list[trimesh.Trimesh]:
    """Return the pieces, those cut that the outline of a patch crosses; the others are the same objects."""
    outlines = [outline for patch in friction_map.patches for outline in patch.outlines]
    return [part for piece in pieces for part in _split_piece(piece, outlines)]


def find_piece_patches(pieces: list[trimesh.Trimesh], friction_map: FrictionMap) -> list[int]:
    """Return the number of the patch that each of the pieces lies in; -1 outside of all."""
    if not pieces:
        return []
    middles = np.array([np.asarray(piece.vertices).mean(axis=0) for piece in pieces])
    return friction_map.find_patches(middles).tolist()


def _split_piece(piece: trimesh.Trimesh, outlines: list[Outline]) -> list[trimesh.Trimesh]:
    inside, rest = [], [piece]
    for outline in outlines:
        parts, rest = rest, []
        for part in parts:
            common, others = _cut_out(part, outline)
            inside += common
            rest += others
    return inside + rest


def _cut_out(piece: trimesh.Trimesh, outline: Outline) -> tuple[list[trimesh.Trimesh], list[trimesh.Trimesh]]:
    """Return the part of a piece below an outline, none or one, and the parts outside of it."""
    corners = np.array(outline)
    low, high = piece.bounds[:, :2]
    if (corners.max(axis=0) <= low).any() or (corners.min(axis=0) >= high).any():
        return [], [piece]
    left, outside = piece, []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([start[1] - end[1], end[0] - start[0], 0.0]) / np.hypot(*(end - start))
        within, beyond = _cut(left, normal, float(normal[:2] @ start))
        if within is None:
            return [], [piece]
        outside += [] if beyond is None else [beyond]
        left = within
    return [left], outside


def _cut(
    piece: trimesh.Trimesh, normal: Float[np.ndarray, " 3"], offset: float
) -> tuple[trimesh.Trimesh | None, trimesh.Trimesh | None]:
    """Return the parts of a piece above and below a plane; None for one that would be a sliver."""
    vertices = np.asarray(piece.vertices, dtype=np.float64)
    height = vertices @ normal - offset
    if height.min() >= -SLIVER:
        return piece, None
    if height.max() <= SLIVER:
        return None, piece
    first, second = piece.edges_unique.T
    crosses = height[first] * height[second] < 0.0
    a, b = first[crosses], second[crosses]
    share = height[a] / (height[a] - height[b])
    section = vertices[a] + share[:, None] * (vertices[b] - vertices[a])
    above, below = (
        make_hull(np.concatenate([vertices[side], section])) for side in (height >= 0.0, height <= 0.0)
    )
    if above is None or below is None:
        return (piece, None) if below is None else (None, piece)
    return above, below
