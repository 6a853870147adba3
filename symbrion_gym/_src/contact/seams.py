"""Convex pieces of a terrain made simpler and tighter where they meet, without moving the ground.

Pieces come with needless corners (a ragged rim, cuts next to creases) and with lips where one ends a little beyond
the crease that it should end at. Each piece is taken as an intersection of half-spaces:

1. A plane of a neighbor caps a piece that sticks out above it, where no ground of its own is lost.
2. A side is moved outwards where that lifts no ground, so that neighbors overlap.
3. A half-space that is not needed is dropped: fewer corners cost less in every contact.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import STEEP, compute_halfspaces, compute_tops, make_solid
from reconstruction._src.geometry.sampling import sample_grid
from symbrion_gym._src.contact.deadline import never
from symbrion_gym._src.contact.decomposition import (
    compute_moments,
    fit_planes,
    measure_deviations,
    weigh_faces,
)
from symbrion_gym._src.contact.planes import Planes

_ON_PLANE = 1e-6  # What lies no farther beyond a plane lies on it: corners are rounded to 1 µm [m]
_ON_FACE = 1e-4  # Corners this close to a plane belong to its face [m]
_INSIDE = 1e-3  # The inner point of a piece stays this far beneath a plane that cuts it [m]


_OVERLAP = 0.03  # Neighbors overlap by this, where that lifts no ground [m]
_REACH = 0.05  # Dropping a half-space may let a piece grow by no more than this [m]
_LIFT = 2e-4  # Ground lifted by less is not lifted [m]
_NOISE = 1e-3  # A piece may rise to the terrain, and this far above it [m]
_MAX_LOSS = 1e-3  # A cut may move no ground away from the terrain by more than this [m]
_TOUCHING = 0.01  # Pieces whose bounds are this close are neighbors [m]
_PIECE_POINTS = 160  # Points a side of the grid on which a piece is looked at
_CHANGE_POINTS = 48  # Points a side of the grid on which a change is looked at


def mend_pieces(
    pieces: list[trimesh.Trimesh],
    ground: Elevation,
    is_exceeded: Callable[[], bool] = never,
) -> list[trimesh.Trimesh]:
    """Return pieces whose union is the same ground, with closed seams, overlap and fewer corners."""
    mended = list(pieces)
    for change in (_cap, _widen, _simplify):
        for i in range(len(mended)):
            if is_exceeded():
                return mended
            mended[i] = change(i, mended, ground)
    return mended


def _is_hidden(
    before: Float[np.ndarray, "H 4"],
    after: Float[np.ndarray, "G 4"],
    points: Float[np.ndarray, "N 2"],
    others: Elevation,
    ground: Elevation,
    air: bool,
) -> bool:
    """Return whether a piece that grew shows nowhere: beneath what was there, or (air) beyond the rim."""
    old, new = compute_tops(before, points), compute_tops(after, points)
    grew = new > old + _ON_PLANE
    if not grew.any():
        return True
    points, old, new = points[grew], old[grew], new[grew]
    height = ground.height(*points.T)
    neighbors = np.nan_to_num(others.height(*points.T), nan=-np.inf)
    is_lifted = (new > np.maximum(old, neighbors) + _LIFT) & ~(new < height + _NOISE)
    is_beyond = np.isnan(height) if air else np.zeros(len(points), dtype=bool)
    return not (is_lifted & ~is_beyond).any()


def _cap(i: int, pieces: list[trimesh.Trimesh], ground: Elevation) -> trimesh.Trimesh:
    """Cut a piece by the tops of its neighbors, where it sticks out above them and loses no ground."""
    piece = pieces[i]
    halfspaces, inner = compute_halfspaces(piece), np.asarray(piece.vertices).mean(axis=0)
    points = sample_grid(np.asarray(piece.vertices), _PIECE_POINTS)
    height, before = ground.height(*points.T), compute_tops(halfspaces, points)
    for j, other in enumerate(pieces):
        if j == i or not _do_touch(piece, other, _TOUCHING):
            continue
        for plane in compute_halfspaces(other):
            is_cut = (np.asarray(piece.vertices) @ plane[:3] + plane[3]).max() > _LIFT
            if plane[2] < STEEP or plane[:3] @ inner + plane[3] > -_INSIDE or not is_cut:
                continue
            lowered = before > -(points @ plane[:2] + plane[3]) / plane[2]
            after = before.copy()
            after[lowered] = compute_tops(np.vstack([halfspaces, plane]), points[lowered])
            lowered[lowered] = before[lowered] - after[lowered] > _LIFT
            if not lowered.any():
                continue
            gain = np.abs(before - height)[lowered] - np.abs(after - height)[lowered]
            if np.nansum(gain) <= 0 or np.nanmin(gain, initial=0.0) <= -_MAX_LOSS:
                continue
            if (made := make_solid(np.vstack([halfspaces, plane]), inner)) is not None:
                piece, halfspaces = made, compute_halfspaces(made)
                before = compute_tops(halfspaces, points)
    return piece


def _do_touch(first: trimesh.Trimesh, second: trimesh.Trimesh, reach: float) -> bool:
    gap = np.maximum(first.bounds[0] - second.bounds[1], second.bounds[0] - first.bounds[1])
    return bool(gap.max() < reach)


def _widen(i: int, pieces: list[trimesh.Trimesh], ground: Elevation) -> trimesh.Trimesh:
    """Move each side of a piece outwards beneath its neighbors, where that lifts nothing."""
    piece = pieces[i]
    others = Elevation(*pieces[:i], *pieces[i + 1 :])
    halfspaces, inner = compute_halfspaces(piece), np.asarray(piece.vertices).mean(axis=0)
    for k in range(len(halfspaces)):
        if abs(halfspaces[k, 2]) > STEEP:
            continue
        wider = halfspaces.copy()
        wider[k, 3] -= _OVERLAP
        made = make_solid(wider, inner)
        if made is None:
            continue
        vertices = np.asarray(made.vertices)
        grown = vertices[vertices @ halfspaces[k, :3] + halfspaces[k, 3] > -_ON_PLANE]
        face = np.asarray(piece.vertices)
        face = face[face @ halfspaces[k, :3] + halfspaces[k, 3] > -_ON_FACE]
        points = sample_grid(np.concatenate([grown, face]), _CHANGE_POINTS)
        if len(grown) and _is_hidden(halfspaces, wider, points, others, ground, air=False):
            piece, halfspaces = made, wider
    return piece


def _simplify(i: int, pieces: list[trimesh.Trimesh], ground: Elevation) -> trimesh.Trimesh:
    """Drop the half-spaces of a piece that make no difference, the smallest faces first."""
    piece = pieces[i]
    others = Elevation(*pieces[:i], *pieces[i + 1 :])
    first, inner = compute_halfspaces(piece), np.asarray(piece.vertices).mean(axis=0)
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
        is_new = vertices @ plane[:3] + plane[3] > -_ON_PLANE
        points = sample_grid(vertices[is_new], _CHANGE_POINTS) if is_new.any() else np.zeros((0, 2))
        if growth.max() < _ON_PLANE or _is_hidden(first, fewer, points, others, ground, air=True):
            piece, kept = made, fewer
    return piece


_SHIFT = 0.3
"""The common plane lies off that of each region by no more than this share of the tolerance (root-mean-square
over the region): less than a body feels."""
_BORDER_WEIGHT = 0.02  # Faces at the border of a region count this much: they may lie on a chamfer


def share_planes(mesh: trimesh.Trimesh, planes: Planes, tolerance: float) -> Planes:
    """Return planes with equal normals and offsets where one plane serves several regions; labels stay.

    The closest two groups of regions are joined first, while the common plane serves all regions of both.
    """
    if not len(planes.normals):
        return planes
    origin = np.asarray(mesh.triangles_center).mean(axis=0)
    sums = _sum_regions(mesh, planes, origin)
    _, _, own = fit_planes(sums)
    groups: dict[int, list[int]] = {k: [k] for k in range(len(sums))}
    shifts = {
        (i, j): _measure_shift(sums, own, planes.normals, [i, j]) for i in groups for j in groups if i < j
    }
    while shifts:
        i, j = min(shifts, key=lambda pair: shifts[pair])
        if shifts[i, j] > _SHIFT * tolerance:
            break
        groups[i] += groups.pop(j)
        shifts = {pair: shift for pair, shift in shifts.items() if j not in pair}
        for k in groups:
            if k != i:
                pair = (min(i, k), max(i, k))
                shifts[pair] = _measure_shift(sums, own, planes.normals, groups[i] + groups[k])
    normals, offsets = planes.normals.copy(), planes.offsets.copy()
    for members in groups.values():
        if len(members) > 1:
            normal, offset = _fit(sums, planes.normals, members)
            normals[members], offsets[members] = normal, offset + normal @ origin
    return planes._replace(normals=normals, offsets=offsets)


def _sum_regions(
    mesh: trimesh.Trimesh, planes: Planes, origin: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "R 4 4"]:
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    weights = weigh_faces(planes.labels, pairs, _BORDER_WEIGHT)
    sums = np.zeros((len(planes.normals), 4, 4))
    np.add.at(sums, np.maximum(planes.labels, 0), compute_moments(mesh, origin) * weights[:, None, None])
    return sums


def _fit(
    sums: Float[np.ndarray, "R 4 4"], normals: Float[np.ndarray, "R 3"], members: list[int]
) -> tuple[Float[np.ndarray, " 3"], float]:
    """Return the common plane of some regions, on the side of the largest."""
    normal, offset, _ = fit_planes(sums[members].sum(axis=0))
    largest = members[int(np.argmax(sums[members, 3, 3]))]
    sign = 1.0 if normal @ normals[largest] > 0 else -1.0
    return sign * normal, sign * float(offset)


def _measure_shift(
    sums: Float[np.ndarray, "R 4 4"],
    own: Float[np.ndarray, " R"],
    normals: Float[np.ndarray, "R 3"],
    members: list[int],
) -> float:
    """Return how far the common plane lies off the worst region's own [m]; inf where a region faces the other way."""
    normal, offset = _fit(sums, normals, members)
    if (normals[members] @ normal).min() <= 0:
        return float("inf")
    square = measure_deviations(sums[members], normal, offset) ** 2 - own[members] ** 2
    return float(np.sqrt(max(square.max(), 0.0)))
