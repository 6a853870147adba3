"""Edges of pieces that hide in the ground, moved out of the way of bodies that slide over it.

A body at rest sinks in by tenths of a millimeter. Where it slides from one piece to the next over a crest, it meets the
upper edge of the next one's hidden end from behind: for the first step the way out across that end is the shortest one,
and the contact pushes the body back. Ends a hair beneath the plane that bodies come from are never met: they stop short
of a crest, and reach into the ground at the foot of a slope. What is hidden as a whole is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import STEEP, find_halfspaces, find_tops, make_solid
from reconstruction._src.geometry.hulls import make_hull
from reconstruction._src.geometry.rectangles import find_box
from reconstruction._src.geometry.sampling import sample_grid

_ON_FACE = 1e-4
"""Corners this close to a plane belong to its face [m]."""
_SAME_SIDE = 1e-4
"""Planes whose coefficients differ by less are one: corners are rounded to 1 µm."""


@dataclass(frozen=True)
class EdgeConfig:
    """How hidden edges are moved.

    Attributes:
        clearance: a hidden edge lies this far beneath the plane that bodies come from [m]: more than they sink in, and
            less than a body feels.
        max_move: an end moves by no more than this [m]: on planes that hardly bend it would leave a gap.
        reach: edges this close to another piece are hidden by it [m]: boxes stand out by as much.
        edge_points: points along an edge that are looked at.
        lift: ground lowered by less is not lowered, when a piece is left out [m].
        piece_points: points a side of the grid on which a piece is looked at.
    """

    clearance: float = 5e-4
    max_move: float = 0.01
    reach: float = 3e-3
    edge_points: int = 9
    lift: float = 2e-4
    piece_points: int = 160


EDGE_DEFAULTS = EdgeConfig()


def clear_hidden_edges(
    pieces: list[trimesh.Trimesh], ground: Elevation, config: EdgeConfig = EDGE_DEFAULTS
) -> list[trimesh.Trimesh]:
    """Return pieces without those that are hidden, whose hidden ends stop short of crests."""
    kept = _drop_hidden(pieces, ground, config)
    halfspaces = [find_halfspaces(piece) for piece in kept]
    return [_shorten(i, kept, halfspaces, config) for i in range(len(kept))]


def _drop_hidden(
    pieces: list[trimesh.Trimesh], ground: Elevation, config: EdgeConfig
) -> list[trimesh.Trimesh]:
    """Return the pieces, without those whose tops lie beneath others wherever there is ground, the smallest first."""
    halfspaces = {i: find_halfspaces(piece) for i, piece in enumerate(pieces)}
    for i in sorted(halfspaces, key=lambda i: float(pieces[i].volume)):
        points = sample_grid(np.asarray(pieces[i].vertices), config.piece_points)
        points = points[np.isfinite(ground.height(*points.T))]
        own = find_tops(halfspaces[i], points)
        others = [find_tops(planes, points) for k, planes in halfspaces.items() if k != i]
        if others and (own <= np.max(others, axis=0) + config.lift).all():
            del halfspaces[i]
    return [pieces[i] for i in sorted(halfspaces)]


def _shorten(
    i: int, pieces: list[trimesh.Trimesh], halfspaces: list[Float[np.ndarray, "H 4"]], config: EdgeConfig
) -> trimesh.Trimesh:
    """Return a piece whose ends stop short of the crests that it has in common with other pieces."""
    piece, planes = pieces[i], halfspaces[i]
    corners = np.asarray(piece.vertices)
    for side in planes[planes[:, 2] <= STEEP]:
        moves = [0.0]
        for top in planes[planes[:, 2] > STEEP]:
            ends = _find_edge(corners, side, top)
            if ends is None:
                continue
            others = (other for j, other in enumerate(halfspaces) if j != i)
            moves += [_find_move(ends, side, top, other, config) for other in others]
        move = max(moves) or min(moves)
        if move:
            piece = _move_side(piece, side, move)
    return piece


def _move_side(piece: trimesh.Trimesh, side: Float[np.ndarray, " 4"], move: float) -> trimesh.Trimesh:
    """Return a piece with a side moved inwards, or outwards below 0 [m]; the piece itself where that is no solid."""
    corners = np.asarray(piece.vertices)
    if find_box(piece) is not None:  # stays a box to the last digit
        is_side = np.abs(corners @ side[:3] + side[3]) < _ON_FACE
        made = make_hull(corners - is_side[:, None] * (move * side[:3]))
    else:
        moved = find_halfspaces(piece)
        moved[np.abs(moved - side).max(axis=1) < _SAME_SIDE, 3] += move
        made = make_solid(moved, corners.mean(axis=0))
    return piece if made is None else made


def _find_edge(
    corners: Float[np.ndarray, "V 3"], side: Float[np.ndarray, " 4"], top: Float[np.ndarray, " 4"]
) -> Float[np.ndarray, "2 3"] | None:
    """Return the ends of the edge between a side and a top; None where they have none."""
    is_on = (np.abs(corners @ side[:3] + side[3]) < _ON_FACE) & (
        np.abs(corners @ top[:3] + top[3]) < _ON_FACE
    )
    if is_on.sum() < 2:
        return None
    edge = corners[is_on]
    along = edge @ np.cross(side[:3], top[:3])
    return edge[[int(along.argmin()), int(along.argmax())]]


def _find_move(
    ends: Float[np.ndarray, "2 3"],
    side: Float[np.ndarray, " 4"],
    top: Float[np.ndarray, " 4"],
    other: Float[np.ndarray, "H 4"],
    config: EdgeConfig,
) -> float:
    """Return how far a side moves until its upper edge is clear of another piece's tops [m].

    Above 0 inwards, from a crest; below 0 outwards, where the edge ends at the foot of a slope; 0 where it may stay.
    """
    share = np.linspace(0.0, 1.0, config.edge_points)[:, None]
    points = (1.0 - share) * ends[0] + share * ends[1]
    inwards = -side[:3] + (side[:3] @ top[:3]) * top[:3]
    inwards /= np.linalg.norm(inwards)
    is_top = other[:, 2] > STEEP
    around = other[~is_top]
    is_near = (points @ around[:, :3].T + around[:, 3]).max(axis=1) < config.reach
    moves = [0.0]
    for plane in other[is_top]:
        heights = (points @ plane[:3] + plane[3])[is_near]
        fall = -float(plane[:3] @ inwards)
        if not len(heights) or fall == 0 or np.abs(heights).max() > config.reach:
            continue
        move = max(float(heights.max()) + config.clearance, 0.0) / fall * -float(side[:3] @ inwards)
        if abs(move) <= config.max_move:
            moves.append(move)
    return max(moves) or min(moves)
