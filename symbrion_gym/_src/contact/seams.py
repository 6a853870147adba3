"""Convex pieces of a terrain tighter where they meet, without moving the ground.

What is hidden beneath others goes, and hidden ends stop short of the crests that bodies slide over.
"""

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import (
    STEEP,
    compute_halfspaces,
    compute_tops,
    find_box,
    make_solid,
)
from reconstruction._src.geometry.rows import make_hull
from reconstruction._src.geometry.sampling import sample_grid

Halfspaces = Float[np.ndarray, "H 4"]  # Inside is a x + b y + c z + d <= 0
Plane = Float[np.ndarray, " 4"]  # One of them

_ON_FACE = 1e-4  # Corners this close to a plane belong to its face [m]
_LIFT = 2e-4  # Ground lifted by less is not [m]
_SAME_SIDE = 1e-4  # Planes whose coefficients differ by less are one: corners are rounded to 1 µm
_CLEARANCE = 5e-4
"""A hidden edge lies this far beneath the plane that bodies come from [m]: more than they sink in, and less
than a body feels."""
_MAX_MOVE = 0.01  # An end moves by no more than this [m]: on planes that hardly bend it would leave a gap
_REACH = 3e-3  # Edges this close to another piece are hidden by it [m]: boxes stand out by as much
_EDGE_POINTS = 9  # Points along an edge that are looked at
_PIECE_POINTS = 160  # Points a side of the grid on which a piece is looked at


def clear_hidden_edges(pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    """Return pieces without those that are hidden, whose hidden ends stop short of crests."""
    kept = _drop_hidden(pieces, ground)
    halfspaces = [compute_halfspaces(piece) for piece in kept]
    return [_shorten(i, kept, halfspaces) for i in range(len(kept))]


def _drop_hidden(pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    """Return the pieces, without those whose tops lie beneath others wherever there is ground, the smallest first."""
    halfspaces = {i: compute_halfspaces(piece) for i, piece in enumerate(pieces)}
    for i in sorted(halfspaces, key=lambda i: float(pieces[i].volume)):
        points = sample_grid(np.asarray(pieces[i].vertices), _PIECE_POINTS)
        points = points[np.isfinite(ground.height(*points.T))]
        own = compute_tops(halfspaces[i], points)
        others = [compute_tops(planes, points) for k, planes in halfspaces.items() if k != i]
        if others and (own <= np.max(others, axis=0) + _LIFT).all():
            del halfspaces[i]
    return [pieces[i] for i in sorted(halfspaces)]


def _shorten(i: int, pieces: list[trimesh.Trimesh], halfspaces: list[Halfspaces]) -> trimesh.Trimesh:
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
            moves += [_find_move(ends, side, top, other) for other in others]
        move = max(moves) or min(moves)
        if move:
            piece = _move_side(piece, side, move)
    return piece


def _move_side(piece: trimesh.Trimesh, side: Plane, move: float) -> trimesh.Trimesh:
    """Return a piece with a side moved inwards, or outwards below 0 [m]; the piece itself where that is no solid."""
    corners = np.asarray(piece.vertices)
    if find_box(piece) is not None:  # stays a box to the last digit
        is_side = np.abs(corners @ side[:3] + side[3]) < _ON_FACE
        made = make_hull(corners - is_side[:, None] * (move * side[:3]))
    else:
        moved = compute_halfspaces(piece)
        moved[np.abs(moved - side).max(axis=1) < _SAME_SIDE, 3] += move
        made = make_solid(moved, corners.mean(axis=0))
    return piece if made is None else made


def _find_edge(corners: Float[np.ndarray, "V 3"], side: Plane, top: Plane) -> Float[np.ndarray, "2 3"] | None:
    """Return the ends of the edge between a side and a top; None where they have none."""
    is_on = (np.abs(corners @ side[:3] + side[3]) < _ON_FACE) & (
        np.abs(corners @ top[:3] + top[3]) < _ON_FACE
    )
    if is_on.sum() < 2:
        return None
    edge = corners[is_on]
    along = edge @ np.cross(side[:3], top[:3])
    return edge[[int(along.argmin()), int(along.argmax())]]


def _find_move(ends: Float[np.ndarray, "2 3"], side: Plane, top: Plane, other: Halfspaces) -> float:
    """Return how far a side moves until its upper edge is clear of another piece's tops [m].

    Above 0 inwards, from a crest; below 0 outwards, where the edge ends at the foot of a slope; 0 where it may stay.
    """
    share = np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None]
    points = (1.0 - share) * ends[0] + share * ends[1]
    inwards = -side[:3] + (side[:3] @ top[:3]) * top[:3]
    inwards /= np.linalg.norm(inwards)
    is_top = other[:, 2] > STEEP
    around = other[~is_top]
    is_near = (points @ around[:, :3].T + around[:, 3]).max(axis=1) < _REACH
    moves = [0.0]
    for plane in other[is_top]:
        heights = (points @ plane[:3] + plane[3])[is_near]
        fall = -float(plane[:3] @ inwards)
        if not len(heights) or fall == 0 or np.abs(heights).max() > _REACH:
            continue
        move = max(float(heights.max()) + _CLEARANCE, 0.0) / fall * -float(side[:3] @ inwards)
        if abs(move) <= _MAX_MOVE:
            moves.append(move)
    return max(moves) or min(moves)
