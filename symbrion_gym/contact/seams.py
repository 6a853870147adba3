"""Convex pieces of a terrain made simpler and tighter where they meet, without moving the ground.

Pieces come with corners that nobody needs (a ragged rim, cuts beside creases) and with lips where one ends a
little beside the crease that it should end at. Each piece is taken as an intersection of half-spaces:

1. A plane of a neighbour caps a piece that sticks out above it, where no ground of its own is lost.
2. A side is moved outwards where that lifts no ground, so that neighbours overlap.
3. A half-space that is not needed is dropped: fewer corners cost less in every contact.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.halfspaces import STEEP, find_halfspaces, find_tops, make_solid
from reconstruction.geometry.sampling import sample_grid

_OVERLAP = 0.03
"""Neighbours overlap by so much, where that lifts no ground [m]."""
_REACH = 0.05
"""Dropping a half-space may let a piece grow by no more than this [m]."""
_LIFT = 2e-4
"""Ground lifted by less is not lifted [m]."""
_NOISE = 1e-3
"""A piece may rise to the terrain, and so far above it [m]."""
_DENSE = 160
"""Points a side of the grid on which a piece is looked at."""
_SAMPLES = 48
"""Points a side of the grid on which a change is looked at."""


def mend_pieces(
    pieces: list[trimesh.Trimesh],
    surface: trimesh.Trimesh,
    is_late: Callable[[], bool] = lambda: False,
) -> list[trimesh.Trimesh]:
    """Return pieces whose union is the same ground, with closed seams, overlap and fewer corners.

    Args:
        pieces: convex solids that follow a terrain from below.
        surface: the terrain.
        is_late: asked now and then; once true, the other pieces stay as they are.
    """
    ground = Elevation(surface)
    mended = list(pieces)
    for change in (_cap, _widen, _simplify):
        for i in range(len(mended)):
            if is_late():
                return mended
            mended[i] = change(i, mended, ground)
    return mended


def _is_hidden(
    before: np.ndarray, after: np.ndarray, points: np.ndarray, others: Elevation, ground: Elevation, air: bool
) -> bool:
    """Whether a piece that grew shows nowhere: beneath what was there, or (air) beyond the rim."""
    old, new = find_tops(before, points), find_tops(after, points)
    grew = new > old + 1e-6
    if not grew.any():
        return True
    points, old, new = points[grew], old[grew], new[grew]
    height = ground.height(*points.T)
    beside = np.nan_to_num(others.height(*points.T), nan=-np.inf)
    is_lifted = (new > np.maximum(old, beside) + _LIFT) & ~(new < height + _NOISE)
    is_beyond = np.isnan(height) if air else np.zeros(len(points), dtype=bool)
    return not (is_lifted & ~is_beyond).any()


def _cap(i: int, pieces: list[trimesh.Trimesh], ground: Elevation) -> trimesh.Trimesh:
    """The piece beneath the tops of its neighbours too, where it sticks out above them and loses no ground."""
    piece = pieces[i]
    halfspaces, inner = find_halfspaces(piece), np.asarray(piece.vertices).mean(axis=0)
    points = sample_grid(np.asarray(piece.vertices), _DENSE)
    height, before = ground.height(*points.T), find_tops(halfspaces, points)
    for j, other in enumerate(pieces):
        if j == i or not _do_touch(piece, other):
            continue
        for plane in find_halfspaces(other):
            is_cut = (np.asarray(piece.vertices) @ plane[:3] + plane[3]).max() > _LIFT
            if plane[2] < STEEP or plane[:3] @ inner + plane[3] > -1e-3 or not is_cut:
                continue
            lowered = before > -(points @ plane[:2] + plane[3]) / plane[2]
            after = before.copy()
            after[lowered] = find_tops(np.vstack([halfspaces, plane]), points[lowered])
            lowered[lowered] = before[lowered] - after[lowered] > _LIFT
            if not lowered.any():
                continue
            gain = np.abs(before - height)[lowered] - np.abs(after - height)[lowered]
            if np.nansum(gain) <= 0 or np.nanmin(gain, initial=0.0) <= -1e-3:
                continue
            if (made := make_solid(np.vstack([halfspaces, plane]), inner)) is not None:
                piece, halfspaces = made, find_halfspaces(made)
                before = find_tops(halfspaces, points)
    return piece


def _do_touch(first: trimesh.Trimesh, second: trimesh.Trimesh) -> bool:
    gap = np.maximum(first.bounds[0] - second.bounds[1], second.bounds[0] - first.bounds[1])
    return bool(gap.max() < 0.01)


def _widen(i: int, pieces: list[trimesh.Trimesh], ground: Elevation) -> trimesh.Trimesh:
    """The piece with each side moved outwards beneath its neighbours, where that lifts nothing."""
    piece = pieces[i]
    others = Elevation(*pieces[:i], *pieces[i + 1 :])
    halfspaces, inner = find_halfspaces(piece), np.asarray(piece.vertices).mean(axis=0)
    for k in range(len(halfspaces)):
        if abs(halfspaces[k, 2]) > STEEP:
            continue
        wider = halfspaces.copy()
        wider[k, 3] -= _OVERLAP
        made = make_solid(wider, inner)
        if made is None:
            continue
        vertices = np.asarray(made.vertices)
        grown = vertices[vertices @ halfspaces[k, :3] + halfspaces[k, 3] > -1e-6]
        face = np.asarray(piece.vertices)
        face = face[face @ halfspaces[k, :3] + halfspaces[k, 3] > -1e-4]
        points = sample_grid(np.concatenate([grown, face]), _SAMPLES)
        if len(grown) and _is_hidden(halfspaces, wider, points, others, ground, air=False):
            piece, halfspaces = made, wider
    return piece


def _simplify(i: int, pieces: list[trimesh.Trimesh], ground: Elevation) -> trimesh.Trimesh:
    """The piece without the half-spaces that nobody misses, the smallest faces first."""
    piece = pieces[i]
    others = Elevation(*pieces[:i], *pieces[i + 1 :])
    first, inner = find_halfspaces(piece), np.asarray(piece.vertices).mean(axis=0)
    kept = first
    for plane in first[::-1]:
        fewer = kept[~(kept == plane).all(axis=1)]
        made = make_solid(fewer, inner) if len(fewer) >= 4 else None
        if made is None:
            continue
        vertices = np.asarray(made.vertices)
        growth = (vertices @ first[:, :3].T + first[:, 3]).max(axis=1)
        if growth.max() > _REACH:
            continue
        is_new = vertices @ plane[:3] + plane[3] > -1e-6
        points = sample_grid(vertices[is_new], _SAMPLES) if is_new.any() else np.zeros((0, 2))
        if growth.max() < 1e-6 or _is_hidden(first, fewer, points, others, ground, air=True):
            piece, kept = made, fewer
    return piece
