"""Fitted slabs as one solid, and the solid as coacd's convex pieces: what coacd is given decides what it gives.

Handed a noisy surface, coacd fills in what is hollow or returns hundreds of pieces. Handed the union of slabs
that lie under fitted planes, a watertight solid of some hundred faces, it needs few pieces and stays close.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.sampling import sample_evenly
from symbrion_gym.contact.decomposition import decompose
from symbrion_gym.contact.planes import Planes
from symbrion_gym.errors import ArenaError

_LEAST_TILT = 0.1
"""Planes tilted less than this (sine) face no direction in plan."""
_LEAST_LENGTH = 1e-12
"""Keeps divisions by the length of a vector finite."""
_NO_HEADING = 1e-9
"""Directions that sum to less than this area cancel out [m²]."""


@dataclass(frozen=True)
class UnionConfig:
    """How slabs are united and the solid decomposed.

    Attributes:
        overlap: slabs are stretched by this in plan before they are united: neighbors then share more than a face.
        threshold: threshold of coacd: concavity left, relative to half the longest extent.
        iterations: of coacd's tree search; 150, its own default, takes twice as long for the same pieces.
        num_points: points of the ground that are compared.
        max_move: walls may move by this [m].
        max_change: ground that differs by less has not changed [m].
        fewer: coacd's pieces are worth it where they are no more than this share of the slabs: its hulls bend planes by
            the threshold, and bodies slow down at what bends.
    """

    overlap: float = 1.0005
    threshold: float = 0.01
    iterations: int = 60
    num_points: int = 60_000
    max_move: float = 0.002
    max_change: float = 0.01
    fewer: float = 0.5


UNION_DEFAULTS = UnionConfig()


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
    slabs: list[trimesh.Trimesh], heading: float = 0.0, overlap: float = UNION_DEFAULTS.overlap
) -> trimesh.Trimesh:
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
    config: UnionConfig = UNION_DEFAULTS,
) -> list[trimesh.Trimesh]:
    """Unite slabs into one solid and decompose it by coacd, whose cuts run along the walls.

    Args:
        slabs: convex solids.
        planes: those of the surface that the slabs follow.
        areas: areas of the faces of that surface [m²].
        seed: seed of coacd's search.
        time_limit: coacd is stopped after this time [s].
        config: how they are united and decomposed.

    Raises:
        ArenaError: the union is not closed, or coacd crashed, ran out of time or found nothing.
    """
    heading = find_heading(planes, areas)
    solid = unite_slabs(slabs, heading, config.overlap)
    pieces = decompose(
        solid,
        config.threshold,
        seed,
        time_limit,
        preprocess_mode="off",
        max_convex_hull=-1,
        mcts_iterations=config.iterations,
    )
    back = trimesh.transformations.rotation_matrix(heading, [0.0, 0.0, 1.0])
    return [piece.apply_transform(back) for piece in pieces]


def has_moved(
    pieces: list[trimesh.Trimesh], slabs: list[trimesh.Trimesh], config: UnionConfig = UNION_DEFAULTS
) -> bool:
    """Return whether more ground differs between pieces and slabs than a move of the slabs by 2 mm would change.

    A pit filled in, a wall moved or a gap at the rim shows here, however small its share of the ground.
    """
    corners = np.concatenate([slab.bounds[:, :2] for slab in slabs])
    points = sample_evenly(corners.min(axis=0), corners.max(axis=0), config.num_points)
    before = Elevation(*slabs)
    points = points[np.isfinite(before.height(*points.T))]
    heights = before.height(*points.T)

    def count_changes(other: Float[np.ndarray, " N"]) -> int:
        return int((~(np.abs(other - heights) <= config.max_change)).sum())

    moves = config.max_move * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    allowed = max(count_changes(before.height(*(points - move).T)) for move in moves)
    return count_changes(Elevation(*pieces).height(*points.T)) > allowed
