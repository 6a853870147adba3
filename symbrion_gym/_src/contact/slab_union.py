"""Fitted slabs as one solid, and the solid as coacd's convex pieces: what coacd is given decides what it gives.

Handed a noisy surface, coacd fills in what is hollow or returns hundreds of pieces. Handed the union of slabs
that lie under fitted planes, a watertight solid of some hundred faces, it needs few pieces and stays close.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import STEEP, compute_halfspaces, compute_tops, make_prism
from reconstruction._src.geometry.outlines import compute_bounds, compute_hull_outline
from reconstruction._src.geometry.sampling import sample_evenly, sample_grid
from symbrion_gym._src.contact.decomposition import decompose
from symbrion_gym._src.contact.planes import Planes
from symbrion_gym._src.errors import ArenaError

_LEAST_TILT = 0.1  # Planes tilted less than this (sine) face no direction in plan
_LEAST_LENGTH = 1e-12  # Keeps divisions by the length of a vector finite
_NO_HEADING = 1e-9  # Directions that sum to less than this area cancel out [m²]
_DIGITS = 9  # Planes whose coefficients are equal to as many digits are one


_OVERLAP = 1.0005
"""Slabs are stretched by this in plan before they are united: neighbors then share more than a face."""
_THRESHOLD = 0.01  # Threshold of coacd: concavity left, relative to half the longest extent
_ITERATIONS = 60  # Of coacd's tree search; 150, its own default, takes twice as long for the same pieces
_NUM_POINTS = 60_000  # Points of the ground that are compared
_MAX_MOVE = 0.002  # Walls may move by this [m]
_MAX_CHANGE = 0.01  # Ground that differs by less has not changed [m]
_TOP_POINTS = 160  # Points a side of the grid on which a piece is compared with the slabs
_MAX_LIFT = 2e-4  # Planes put back on a piece may lift the ground by this [m]
_MAX_BULGE = 2e-3  # ... and lower it by this [m]: coacd's pieces overlap by about as much.
_UNION_FEW = 2e-3  # ... but for this share of the points, at walls.


def find_heading(planes: Planes, areas: Float[np.ndarray, " F"]) -> float:
    """Return the direction in plan that most slopes and walls face or run along, in ±45 degrees [rad].

    coacd cuts along the axes; a terrain turned against them would come out in many more pieces.
    """
    is_known = planes.labels >= 0
    weights = np.bincount(planes.labels[is_known], areas[is_known], minlength=len(planes.normals))
    slopes = planes.normals[:, 0] + 1j * planes.normals[:, 1]
    tilt = np.abs(slopes)
    weights = np.where(tilt > _LEAST_TILT, weights * tilt, 0.0)
    # Directions a quarter turn apart count as one: the fourth power has the same angle for all of them.
    total = np.sum(weights * (slopes / np.maximum(tilt, _LEAST_LENGTH)) ** 4)
    return float(np.angle(total) / 4.0) if abs(total) > _NO_HEADING else 0.0


def unite_slabs(
    slabs: list[trimesh.Trimesh], heading: float = 0.0, overlap: float = _OVERLAP
) -> trimesh.Trimesh:
    """Return the union of slabs, turned about z so that `heading` [rad] lies along x."""
    if not slabs:
        raise ArenaError("there are no slabs to unite")
    turn = trimesh.transformations.rotation_matrix(-heading, [0.0, 0.0, 1.0])
    parts = []
    for slab in slabs:
        part = slab.copy().apply_transform(turn)
        middle = part.bounds.mean(axis=0)
        part.vertices = middle + (part.vertices - middle) * [overlap, overlap, 1.0]
        parts.append(part)
    try:
        solid = trimesh.boolean.union(parts, engine="manifold", check_volume=False)
    except (ValueError, ImportError, RuntimeError) as error:
        raise ArenaError(f"{len(slabs)} slabs cannot be united: {error}") from error
    if not len(solid.faces) or not solid.is_watertight:
        raise ArenaError(f"the union of {len(slabs)} slabs is not a closed solid")
    return solid


def decompose_slabs(
    slabs: list[trimesh.Trimesh],
    planes: Planes,
    areas: Float[np.ndarray, " F"],
    seed: int,
    time_limit: float,
) -> list[trimesh.Trimesh]:
    """Unite slabs into one solid and decompose it by coacd, whose cuts run along the walls."""
    heading = find_heading(planes, areas)
    solid = unite_slabs(slabs, heading, _OVERLAP)
    pieces = decompose(
        solid,
        _THRESHOLD,
        seed,
        time_limit,
        preprocess_mode="off",
        max_convex_hull=-1,
        mcts_iterations=_ITERATIONS,
    )
    back = trimesh.transformations.rotation_matrix(heading, [0.0, 0.0, 1.0])
    return [piece.apply_transform(back) for piece in pieces]


def restore_planes(pieces: list[trimesh.Trimesh], slabs: list[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Return coacd's pieces with the slabs' planes on top, down to the bottom of the slabs.

    coacd decides what is one piece; its hulls bulge by the threshold, several millimeters on ground of some meters, and
    end where solids touch. A piece on which nothing rests stays as it is.
    """
    halfspaces = np.concatenate([compute_halfspaces(slab) for slab in slabs])
    tops = np.unique(np.round(halfspaces[halfspaces[:, 2] > STEEP], _DIGITS), axis=0)
    ground = Elevation(*slabs)
    bottom = min(float(slab.bounds[0, 2]) for slab in slabs)
    return [_restore(piece, tops, bottom, ground) for piece in pieces]


def _restore(
    piece: trimesh.Trimesh,
    tops: Float[np.ndarray, "T 4"],
    bottom: float,
    ground: Elevation,
) -> trimesh.Trimesh:
    """Return the prism under a piece's planes; the piece itself where nothing rests on it."""
    points = sample_grid(np.asarray(piece.vertices), _TOP_POINTS)
    height, before = ground.height(*points.T), compute_tops(compute_halfspaces(piece), points)
    is_known = np.isfinite(height) & np.isfinite(before)
    points, height, before = points[is_known], height[is_known], before[is_known]
    is_own = np.abs(before - height) < _MAX_CHANGE
    if not is_own.any():
        return piece
    levels = -(points @ tops[:, :2].T + tops[:, 3]) / tops[:, 2]
    chosen = _choose_planes(levels[is_own], height[is_own], _MAX_LIFT)
    outline = compute_hull_outline(np.asarray(piece.vertices)[:, :2])
    made = (
        make_prism(compute_bounds(outline), tops[chosen], bottom) if chosen and outline is not None else None
    )
    if made is None:
        raise ArenaError("a piece of coacd has no planes of its own")
    after = compute_tops(compute_halfspaces(made), points)
    lifted = after - np.maximum(height, before)
    lost = (np.minimum(before, height) - after)[is_own]
    is_off = np.concatenate([lifted > _MAX_LIFT, lost > _MAX_BULGE])
    if is_off.sum() > _UNION_FEW * len(points):
        raise ArenaError("a piece of coacd bends planes")
    return made


def _choose_planes(
    levels: Float[np.ndarray, "N T"], height: Float[np.ndarray, " N"], tolerance: float
) -> list[int]:
    """Return the planes whose minimum is the ground, those with the most ground first."""
    share = (np.abs(levels - height[:, None]) < tolerance).sum(axis=0)
    chosen: list[int] = []
    top, error = np.full(len(height), np.inf), np.inf
    for k in np.argsort(-share, kind="stable"):
        lower = np.minimum(top, levels[:, k])
        if share[k] and (lower_error := float(np.abs(lower - height).sum())) < error:
            chosen.append(int(k))
            top, error = lower, lower_error
    return chosen


def has_moved(pieces: list[trimesh.Trimesh], slabs: list[trimesh.Trimesh]) -> bool:
    """Return whether more ground differs between pieces and slabs than a move of the slabs by 2 mm would change.

    A pit filled in, a wall moved or a gap at the rim shows here, however small its share of the ground.
    """
    corners = np.concatenate([slab.bounds[:, :2] for slab in slabs])
    points = sample_evenly(corners.min(axis=0), corners.max(axis=0), _NUM_POINTS)
    before = Elevation(*slabs)
    points = points[np.isfinite(before.height(*points.T))]
    heights = before.height(*points.T)

    def count_changes(other: Float[np.ndarray, " N"]) -> int:
        return int((~(np.abs(other - heights) <= _MAX_CHANGE)).sum())

    moves = _MAX_MOVE * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    allowed = max(count_changes(before.height(*(points - move).T)) for move in moves)
    return count_changes(Elevation(*pieces).height(*points.T)) > allowed
