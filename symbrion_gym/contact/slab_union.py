"""Fitted slabs as one solid, and the solid as coacd's convex pieces: what coacd is given decides what it gives.

Handed a noisy surface, coacd fills in what is hollow or returns hundreds of pieces. Handed the union of slabs
that lie under fitted planes, a watertight solid of some hundred faces, it needs few pieces and stays close.
"""

from __future__ import annotations

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.sampling import sample_box
from symbrion_gym.contact.decomposition import decompose
from symbrion_gym.contact.planes import Planes
from symbrion_gym.errors import ArenaError

_OVERLAP = 1.0005
"""Slabs are stretched by this in plan before they are united, so that neighbours share more than a face."""
_THRESHOLD = 0.01
_SEARCH_ITERATIONS = 60
"""Of coacd's tree search; 150, its own choice, takes twice as long for the same pieces."""
_MAX_MOVE = 0.002
"""Walls may move by so much [m]."""
_STEP = 0.01
"""Ground that differs by less has not changed [m]."""
_NUM_POINTS = 60_000


def decompose_slabs(
    slabs: list[trimesh.Trimesh],
    planes: Planes,
    areas: np.ndarray,
    seed: int,
    time_limit: float,
    processor_limit: float | None = None,
) -> list[trimesh.Trimesh]:
    """Unite slabs into one solid and decompose it by coacd, whose cuts run along the walls.

    Args:
        slabs: convex solids.
        planes: those of the surface that the slabs follow.
        areas: `[F]` area of each face of that surface [m²].
        seed: of coacd's search.
        time_limit: coacd is ended after this time [s].
        processor_limit: likewise, after this processor time [s].

    Raises:
        ArenaError: the union is not closed, or coacd crashed, ran out of time or found nothing.
    """
    heading = find_heading(planes, areas)
    solid = unite_slabs(slabs, heading)
    pieces = decompose(
        solid,
        _THRESHOLD,
        seed,
        time_limit,
        processor_limit,
        preprocess_mode="off",
        max_convex_hull=-1,
        mcts_iterations=_SEARCH_ITERATIONS,
    )
    back = trimesh.transformations.rotation_matrix(heading, [0.0, 0.0, 1.0])
    return [piece.apply_transform(back) for piece in pieces]


def find_heading(planes: Planes, areas: np.ndarray) -> float:
    """Return the direction in plan that most slopes and walls face or run along, in ±45 degrees [rad].

    coacd cuts along the axes; a terrain turned against them would come out in many more pieces.
    """
    is_known = planes.labels >= 0
    weights = np.bincount(planes.labels[is_known], areas[is_known], minlength=len(planes.normals))
    slopes = planes.normals[:, 0] + 1j * planes.normals[:, 1]
    tilt = np.abs(slopes)
    weights = np.where(tilt > 0.1, weights * tilt, 0.0)
    # Directions a quarter turn apart count as one: the fourth power has the same angle for all of them.
    total = np.sum(weights * (slopes / np.maximum(tilt, 1e-12)) ** 4)
    return float(np.angle(total) / 4.0) if abs(total) > 1e-9 else 0.0


def unite_slabs(slabs: list[trimesh.Trimesh], heading: float = 0.0) -> trimesh.Trimesh:
    """Return the union of slabs, turned about z so that `heading` [rad] lies along x.

    Raises:
        ArenaError: there is none, or it is not closed.
    """
    if not slabs:
        raise ArenaError("there are no slabs to unite")
    turn = trimesh.transformations.rotation_matrix(-heading, [0.0, 0.0, 1.0])
    parts = []
    for slab in slabs:
        part = slab.copy().apply_transform(turn)
        middle = part.bounds.mean(axis=0)
        part.vertices = middle + (part.vertices - middle) * [_OVERLAP, _OVERLAP, 1.0]
        parts.append(part)
    try:
        solid = trimesh.boolean.union(parts, engine="manifold", check_volume=False)
    except (ValueError, ImportError, RuntimeError) as error:
        raise ArenaError(f"{len(slabs)} slabs cannot be united: {error}") from error
    if not len(solid.faces) or not solid.is_watertight:
        raise ArenaError(f"the union of {len(slabs)} slabs is not a closed solid")
    return solid


def has_moved(pieces: list[trimesh.Trimesh], slabs: list[trimesh.Trimesh]) -> bool:
    """Tell whether more ground differs between pieces and slabs than a move of the slabs by 2 mm would change.

    A pit filled in, a wall moved or a gap at the rim shows here, however small its share of the ground.
    """
    points = sample_box(np.concatenate([slab.bounds[:, :2] for slab in slabs]), _NUM_POINTS)
    before = Elevation(*slabs)
    points = points[np.isfinite(before.height(*points.T))]
    heights = before.height(*points.T)

    def count_changes(other: np.ndarray) -> int:
        return int((~(np.abs(other - heights) <= _STEP)).sum())

    moves = _MAX_MOVE * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    allowed = max(count_changes(before.height(*(points - move).T)) for move in moves)
    return count_changes(Elevation(*pieces).height(*points.T)) > allowed
