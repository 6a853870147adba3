"""Find where a surface passes through itself or doubles back.

Two triangles that share no edge intersect, or do not: libigl decides. Two that share an edge cannot pass through each
other, but can lie folded together: the angle between them decides.

References:
    Guigue and Devillers (2003), "Fast and robust triangle-triangle overlap test using orientation predicates",
    Journal of Graphics Tools 8(1): what libigl computes.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import Hinges, compute_normals, find_hinges, group_sides
from reconstruction._src.geometry.rows import (
    Faces,
    Vertices,
    all_rows,
    any_rows,
    compute_lengths,
    cross_rows,
    sum_rows,
)

FOLD_ANGLE = np.deg2rad(120)
"""Two faces at an edge are a fold where their normals differ by more: a level sheet has 0 degrees, a right-angled
crease 90, a face laid back onto its neighbor 180."""
_SIZES_APART = 2.0
"""Faces are compared by size: the largest of a group is at most this many times as large as the smallest.
It changes the time alone."""
_ROUNDING = 1.0 + 1e-9  # Balls that touch by less than rounding are not lost
_SHRINKAGE = 1e-6
"""A corner that two triangles share is moved into the first by this share of the way to its center before they are
tested: so they intersect only where they meet elsewhere, too. Far above the rounding of floats, far below any gap."""
_SHORTEST = 1e-300  # Taken for 0 where a logarithm is


def find_folded_edges(vertices: Vertices, faces: Faces) -> Int[np.ndarray, "P 2"]:
    """Return the pairs of faces at the edges where the surface doubles back."""
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    return hinges.faces[measure_bends(vertices, faces, hinges) < np.cos(FOLD_ANGLE)]


def measure_bends(vertices: Vertices, faces: Faces, hinges: Hinges) -> Float[np.ndarray, " P"]:
    """Return the cosine between the normals of the two faces at every hinge; 1 where the surface is flat."""
    normals = compute_normals(vertices, faces)
    cosine = sum_rows(normals[hinges.faces[:, 0]] * normals[hinges.faces[:, 1]])
    return np.where(hinges.is_consistent, cosine, -cosine)


def find_intersections(
    vertices: Vertices, faces: Faces, is_selected: Bool[np.ndarray, " F"] | None = None
) -> Int[np.ndarray, "P 2"]:
    """Return the pairs of faces that intersect, in ascending order; none that share an edge.

    Faces that share a corner intersect where they meet elsewhere, too. Touching counts. Faces without area are
    left out.
    """
    corners = np.asarray(vertices, dtype=np.float64)[faces]
    pairs = _find_near(corners, np.ones(len(faces), dtype=bool) if is_selected is None else is_selected)
    one, other = faces[pairs[:, 0]], faces[pairs[:, 1]]
    is_shared = np.stack([any_rows(one[:, [k]] == other) for k in range(3)], axis=1)
    is_apart = sum_rows(is_shared.astype(np.int8)) < 2
    pairs, is_shared = pairs[is_apart], is_shared[is_apart]
    first, second = corners[pairs[:, 0]], corners[pairs[:, 1]]
    inward = np.where(is_shared[..., None], first.mean(axis=1, keepdims=True) - first, 0.0)
    first = first + _SHRINKAGE * inward
    is_open = ~_is_separated(first, second)
    is_open[is_open] = ~_is_separated(second[is_open], first[is_open])
    import igl

    sixes = np.concatenate([first[is_open], second[is_open]], axis=1)[:, :, None]
    is_hit = np.array([igl.tri_tri_intersection_test_3d(*six)[0] for six in sixes], dtype=bool)
    return np.unique(np.sort(pairs[is_open][is_hit], axis=1), axis=0)


def _find_near(
    corners: Float[np.ndarray, "F 3 3"], is_selected: Bool[np.ndarray, " F"]
) -> Int[np.ndarray, "P 2"]:
    """Return the pairs of triangles, one of them selected, whose boxes overlap.

    Triangles of about one size are compared with those of their size and smaller ones: a few large ones among many
    small cost little.
    """
    a, b, c = corners.swapaxes(0, 1)
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    centers = (low + high) / 2
    radius = compute_lengths(high - low) / 2
    may_meet = compute_lengths(cross_rows(b - a, c - a)) > 0
    if is_selected.any():  # those far from all selected ones take no part
        bottom, top = low[is_selected].min(axis=0), high[is_selected].max(axis=0)
        may_meet &= all_rows((low <= top) & (high >= bottom))
    size = np.where(may_meet, np.ceil(np.log(np.maximum(radius, _SHORTEST)) / np.log(_SIZES_APART)), np.inf)
    found = [np.empty((0, 2), dtype=np.int64)]
    for largest in np.unique(size[may_meet]):
        is_large, is_smaller = size == largest, size < largest
        for one, other in (
            (is_large & is_selected, is_large | is_smaller),
            (is_large & ~is_selected, is_smaller & is_selected),
        ):
            one, other = np.flatnonzero(one), np.flatnonzero(other)
            if len(one) == 0 or len(other) == 0:
                continue
            trees = [cKDTree(centers[part], balanced_tree=False) for part in (one, other)]
            near = trees[0].sparse_distance_matrix(
                trees[1], 2 * _ROUNDING * radius[is_large].max(), output_type="ndarray"
            )
            one, other = one[near["i"]], other[near["j"]]
            is_near = near["v"] <= _ROUNDING * (radius[one] + radius[other])
            one, other = one[is_near], other[is_near]
            is_new = is_smaller[other] | ~is_selected[other] | (one < other)
            one, other = one[is_new], other[is_new]
            is_met = all_rows((low[one] <= high[other]) & (low[other] <= high[one]))
            found.append(np.stack([one[is_met], other[is_met]], axis=1))
    return np.concatenate(found)


def _is_separated(
    triangle: Float[np.ndarray, "P 3 3"], other: Float[np.ndarray, "P 3 3"]
) -> Bool[np.ndarray, " P"]:
    """Return whether the second triangle of each pair lies beyond the plane or an edge of the first."""
    sides = np.roll(triangle, -1, axis=1) - triangle
    normal = cross_rows(sides[:, 0], sides[:, 1])
    height = sum_rows(normal[:, None] * (other - triangle[:, :1]))
    is_separated = all_rows(height > 0) | all_rows(height < 0)
    for side in range(3):
        outward = cross_rows(sides[:, side], normal)
        is_separated |= all_rows(sum_rows(outward[:, None] * (other - triangle[:, side, None])) > 0)
    return is_separated
