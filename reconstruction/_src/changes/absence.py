"""Which parts of a surface new readings no longer show, though they show what surrounds them."""

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped
from scipy.spatial import cKDTree

from reconstruction._src.changes.neighborhoods import number_parts
from reconstruction._src.geometry.boxes import find_inside, find_near_box
from reconstruction._src.geometry.rows import any_corner, find_extent, find_lengths

_AXIS_SAMPLES = 4096
"""As many vertices of a patch determine the plane in which it extends most."""


_COMPLETE_SHARE = 0.8
"""New readings on this share of the surface are taken for a whole new scan: what they do not show is gone. Lower, and
a partial scan removes what the scanner could not see."""
_NUM_SECTORS = 12
"""Directions around a patch in which readings must lie just beyond it. More, and small gaps between the readings keep
a patch that is gone."""
_RIM_WIDTH = 6.0
"""Readings up to this many vertex spacings beyond the patch's extent lie just beyond it."""
_MIN_PATCH = 3
"""Vertices of the smallest patch that can be gone; fewer miss their readings by chance."""
_READING_REACH = 1.5
"""A vertex is read where a new reading lies within this many times the usual distance between readings, and one
vertex spacing. Smaller, and vertices between sparse readings seem unread."""
_DENSITY_NEIGHBORS = 5
"""Readings in the ball that measures the density, its center included."""
_NUM_DENSITY_PROBES = 256
"""Places at which the density of the new readings is measured."""


def thin(rows: Shaped[np.ndarray, "N ..."], most: int) -> Shaped[np.ndarray, "M ..."]:
    """Return every n-th of the rows, at most `most` of them."""
    return rows[:: max(1, -(-len(rows) // most))]


def find_read(
    vertices: Float[np.ndarray, "V 3"],
    new_points: Float[np.ndarray, "M 3"],
    spacing: float,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices have a new reading as near as the density predicts."""
    tree = cKDTree(new_points, balanced_tree=False)
    probes = thin(new_points, _NUM_DENSITY_PROBES)
    near = min(_DENSITY_NEIGHBORS, len(new_points))
    usual = float(np.median(tree.query(probes, k=near)[0].reshape(len(probes), -1)[:, -1]))
    reach = _READING_REACH * usual + spacing
    is_read = np.zeros(len(vertices), dtype=bool)
    about = find_near_box(vertices, new_points, reach)
    is_read[about] = np.isfinite(tree.query(vertices[about], distance_upper_bound=reach)[0])
    return is_read


def find_gone(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    new_points: Float[np.ndarray, "M 3"],
    is_read: Bool[np.ndarray, " V"],
    spacing: float,
) -> Bool[np.ndarray, " V"]:
    """Return which vertices are gone: not read again, though what surrounds them was.

    A connected patch without readings is gone if new readings lie on all sides of it (in the plane in which
    it extends most), or if nearly all of the surface was read again. Else it was only out of sight.
    """
    is_gone = np.zeros(len(vertices), dtype=bool)
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[faces] = True
    missing = is_used & ~is_read
    if not missing.any():
        return is_gone
    if is_read[is_used].mean() >= _COMPLETE_SHARE:
        return missing
    low, high = find_extent(new_points)
    margin = (high - low).max() / 2 + spacing
    is_within = np.zeros(len(vertices), dtype=bool)
    is_within[find_inside(vertices, low - margin, high + margin)] = True
    if not (missing & is_within).any():
        return is_gone
    part = number_parts(faces[any_corner(missing & is_within, faces)], missing)
    # A patch that goes on beyond the readings is not surrounded by them.
    is_open = np.bincount(part[missing], ~is_within[missing]) > 0
    is_large = np.bincount(part[missing]) >= _MIN_PATCH
    for number in np.flatnonzero(is_large & ~is_open):
        patch = np.flatnonzero(part == number)
        is_gone[patch] = _is_surrounded(vertices[patch], new_points, spacing)
    return is_gone


def _is_surrounded(
    patch: Float[np.ndarray, "P 3"], readings: Float[np.ndarray, "M 3"], spacing: float
) -> bool:
    """Return whether there are readings just beyond the patch in each sector around it."""
    center = patch.mean(axis=0)
    axes = np.linalg.svd(patch[:_AXIS_SAMPLES] - center, full_matrices=False)[2][:2]
    inside, inside_sector = _to_polar((patch - center) @ axes.T, _NUM_SECTORS)
    around, around_sector = _to_polar((readings - center) @ axes.T, _NUM_SECTORS)
    extent = np.zeros(_NUM_SECTORS)
    np.maximum.at(extent, inside_sector, inside)
    gap = around - extent[around_sector]
    is_beyond = (gap > 0) & (gap < extent.max() + _RIM_WIDTH * spacing)
    return len(np.unique(around_sector[is_beyond])) == _NUM_SECTORS


def _to_polar(
    points: Float[np.ndarray, "N 2"], num_sectors: int
) -> tuple[Float[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return the distance from the origin and the number of the sector."""
    angle = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) % 1.0
    return find_lengths(points), np.minimum((angle * num_sectors).astype(int), num_sectors - 1)
