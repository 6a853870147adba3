"""Which faces lie far from every reading, after a part of the surface and of the readings has changed.

What neither has changed nor lost readings is as it was: the cost is that of the change.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64
from scipy.spatial import cKDTree

from reconstruction._src.geometry.boxes import find_near_box
from reconstruction._src.geometry.rows import any_corner, find_extent
from reconstruction._src.surfaces.far_faces import (
    FAR_DEFAULTS,
    FarConfig,
    FarFaces,
    SeenPoints,
    find_far_among,
    find_open,
    find_samples,
    measure_far_faces,
)

_REACHES = 3.0
"""Readings within this many of the widest reaches of a face are looked at first; farther ones only where these do not
tell."""
_MOST_CELLS = 1 << 24
"""More cells than these are not worth their memory [bytes]."""
_BELOW = 0.999
"""Cells are smaller than they may be by this factor: no rounding makes two places in one be farther apart."""
_MULTIPLIERS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
"""Odd numbers that mix the bits of three coordinates into one key."""


class Sheet(NamedTuple):
    """A surface.

    Attributes:
        vertices: [m].
        faces: vertex indices.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]


def update_far_faces(
    before: FarFaces,
    old: Sheet,
    new: Sheet,
    removed: Float[np.ndarray, "D 3"],
    cloud: SeenPoints,
    config: FarConfig = FAR_DEFAULTS,
) -> FarFaces:
    """Return which faces lie far from every reading, where most are known from before.

    Faces that are new, that were far, or that have lost readings are tested, against the spacing from before.

    Args:
        before: what was found in the old surface.
        old: the surface before.
        new: the surface now.
        removed: readings that are no longer valid [m].
        cloud: readings of the surface now.
        config: what is far.
    """
    vertices, faces = new
    if before.spacing <= 0 or len(cloud.points) <= config.neighbors or not len(faces):
        return measure_far_faces(vertices, faces, cloud, config)
    place = find_same_faces(old, new)
    is_far = (place >= 0) & before.is_far[place]
    reach = config.plane_reach * before.spacing
    tested = np.flatnonzero((place < 0) | is_far | _have_lost(new, removed, reach))
    if len(tested):
        is_far[tested] = _test(new, tested, _REACHES * reach, before.spacing, cloud, config)
    return FarFaces(is_far, before.spacing)


def find_same_faces(old: Sheet, new: Sheet) -> Int[np.ndarray, " G"]:
    """Return for each new face the index of the old one with the same corners, to the bit, in the same order, else -1.

    Args:
        old: the surface before.
        new: the surface now.
    """
    keys, wanted = (_make_keys(sheet) for sheet in (old, new))
    order = np.argsort(keys, kind="stable")
    found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(order) - 1)]
    is_same = keys[found] == wanted
    same = new.vertices[new.faces[is_same]] == old.vertices[old.faces[found[is_same]]]
    is_same[is_same] = same.reshape(-1, 9).all(axis=1)
    return np.where(is_same, found, -1)


def _make_keys(sheet: Sheet) -> UInt64[np.ndarray, " F"]:
    """Return a key of the corners of each face; few others have the same."""
    with np.errstate(over="ignore"):
        bits = np.ascontiguousarray(sheet.vertices, dtype=np.float64).view(np.uint64)
        mixed = (bits ^ (bits >> np.uint64(29))) * _MULTIPLIERS
        corner = mixed[:, 0] ^ (mixed[:, 1] >> np.uint64(7)) ^ (mixed[:, 2] << np.uint64(9))
        keys = corner[sheet.faces] * _MULTIPLIERS
        return keys[:, 0] ^ (keys[:, 1] >> np.uint64(11)) ^ (keys[:, 2] << np.uint64(5))


def _have_lost(new: Sheet, removed: Float[np.ndarray, "D 3"], reach: float) -> Bool[np.ndarray, " F"]:
    """Return which faces have a corner within reach of a removed reading."""
    is_near = np.zeros(len(new.vertices), dtype=bool)
    if len(removed):
        about = find_near_box(new.vertices, removed, reach)
        tree = cKDTree(removed, balanced_tree=False)
        distance, _ = tree.query(new.vertices[about], distance_upper_bound=reach)
        is_near[about] = np.isfinite(distance)
    return any_corner(is_near, new.faces)


def _test(
    new: Sheet,
    tested: Int[np.ndarray, " T"],
    reach: float,
    spacing: float,
    cloud: SeenPoints,
    config: FarConfig,
) -> Bool[np.ndarray, " T"]:
    """Return which of the tested faces are far, by the readings around them where these tell, else by all."""
    vertices, faces = new
    near = cloud.points[find_near_box(cloud.points, vertices[faces[tested].ravel()], reach)]
    is_far = np.zeros(len(tested), dtype=bool)
    if len(near):
        limit = config.seen_reach * spacing
        samples = find_samples(vertices, faces[tested])
        is_unsure = find_beside_none(samples, near, limit).any(axis=1)
        rows = np.flatnonzero(is_unsure)
        if not len(rows):
            return is_far
        around = near[find_around(near, samples[rows].reshape(-1, 3), 2 * limit)]
        tree = cKDTree(around, balanced_tree=False, compact_nodes=False)
        samples, is_open = find_open(vertices, faces[tested[rows]], tree, spacing, config)
        samples, rows = samples[is_open], rows[is_open.any(axis=1)]
        if not len(rows):
            return is_far
        near = near[find_around(near, samples, reach)]
        distance, _ = cKDTree(samples).query(near, distance_upper_bound=reach)
        near = near[np.isfinite(distance)]
        if len(near) > config.neighbors:
            found, needed = _test_part(new, tested[rows], near, spacing, cloud, config)
            if needed <= reach:
                is_far[rows] = found
                return is_far
    tree = cKDTree(cloud.points, balanced_tree=False)
    return find_far_among(vertices, faces, tested, tree, spacing, cloud, config)[0]


def find_beside_none(
    samples: Float[np.ndarray, "*shape 3"], points: Float[np.ndarray, "N 3"], distance: float
) -> Bool[np.ndarray, " *shape"]:
    """Return which samples share no cell with a point, of cells so small that all in one are within a distance.

    Of the others it is certain that a point is that near; all are returned where there would be too many cells.

    Args:
        samples: places [m].
        points: at least one [m].
        distance: length of a cell's diagonal [m].
    """
    low, high = find_extent(points)
    side = _BELOW * distance / np.sqrt(3)
    shape = np.floor((high - low) / side).astype(np.int64) + 1
    if shape.astype(np.float64).prod() > _MOST_CELLS:
        return np.ones(samples.shape[:-1], dtype=bool)
    has_point = np.zeros(shape, dtype=bool)
    has_point[tuple(np.floor((points - low) / side).astype(np.int64).T)] = True
    cells = np.floor((samples.reshape(-1, 3) - low) / side).astype(np.int64)
    is_inside = ((cells >= 0) & (cells < shape)).all(axis=1)
    is_open = np.ones(len(cells), dtype=bool)
    is_open[is_inside] = ~has_point[tuple(cells[is_inside].T)]
    return is_open.reshape(samples.shape[:-1])


def find_around(
    points: Float[np.ndarray, "N 3"], places: Float[np.ndarray, "M 3"], reach: float
) -> Int[np.ndarray, " K"]:
    """Return the points that may lie within reach of a place: in its cell or the next; ascending indices.

    All points in the box around the places are returned where there would be too many cells.

    Args:
        points: [m].
        places: at least one [m].
        reach: length of a cell's side [m].
    """
    inside = find_near_box(points, places, reach)
    low, high = find_extent(places)
    low = low - 2 * reach
    shape = np.floor((high - low) / reach).astype(np.int64) + 3
    if shape.astype(np.float64).prod() > _MOST_CELLS:
        return inside
    has_place = np.zeros(shape, dtype=bool)
    has_place[tuple(np.floor((places - low) / reach).astype(np.int64).T)] = True
    for axis in range(3):
        along = has_place.swapaxes(0, axis)
        wide = along.copy()
        wide[1:] |= along[:-1]
        wide[:-1] |= along[1:]
        has_place = wide.swapaxes(0, axis)
    cells = np.floor((points[inside] - low) / reach).astype(np.int64)
    return inside[has_place[tuple(cells.T)]]


def _test_part(
    new: Sheet,
    tested: Int[np.ndarray, " T"],
    near: Float[np.ndarray, "N 3"],
    spacing: float,
    cloud: SeenPoints,
    config: FarConfig,
) -> tuple[Bool[np.ndarray, " T"], float]:
    """Return what `find_far_among` finds, with only the faces around the readings."""
    is_about = np.zeros(len(new.vertices), dtype=bool)
    is_about[find_near_box(new.vertices, near, config.plane_reach * spacing)] = True
    is_about[new.faces[tested]] = True
    part = np.flatnonzero(any_corner(is_about, new.faces))
    tree = cKDTree(near, balanced_tree=False)
    return find_far_among(
        new.vertices, new.faces[part], np.searchsorted(part, tested), tree, spacing, cloud, config
    )
