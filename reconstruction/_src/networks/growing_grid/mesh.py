"""The triangles of a grid of units: which diagonal splits a cell, and how folds are taken out."""

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.rows import cross_rows, find_lengths, sum_rows
from reconstruction._src.surfaces.unfolding import unfold_faces, unfold_part

MAX_UNFOLDINGS = 6
"""Passes that take folds out; few folds need more than two, and the rest is taken out as triangles."""
MAX_SPLITS = 4
"""Moved units may split cells across other diagonals; the result is tested again at most this many times."""


def triangulate(
    units: Float[np.ndarray, "R C 3"], has_face: Bool[np.ndarray, "R-1 C-1"]
) -> Int[np.ndarray, "F 3"]:
    """Split every cell into two triangles, across the diagonal that gives the better worse triangle."""
    rows, columns = units.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    normal = cell_normals(units)
    flat = units.reshape(-1, 3)
    through_ac = np.minimum(_shape(flat, a, b, c, normal), _shape(flat, a, c, d, normal))
    through_bd = np.minimum(_shape(flat, a, b, d, normal), _shape(flat, b, c, d, normal))
    is_ac = through_ac >= through_bd
    first = np.stack([a, b, np.where(is_ac, c, d)], axis=-1)
    second = np.stack([np.where(is_ac, a, b), c, d], axis=-1)
    return np.stack([first, second], axis=2)[has_face].reshape(-1, 3)


def cell_normals(units: Float[np.ndarray, "R C 3"]) -> Float[np.ndarray, "R-1 C-1 3"]:
    """Return a unit normal for every cell, the mean over the 3 x 3 cells around it."""
    across = cross_rows(units[1:, 1:] - units[:-1, :-1], units[:-1, 1:] - units[1:, :-1])
    wide = np.pad(across, ((1, 1), (0, 0), (0, 0)))
    wide = np.pad(wide[:-2] + wide[1:-1] + wide[2:], ((0, 0), (1, 1), (0, 0)))
    total = wide[:, :-2] + wide[:, 1:-1] + wide[:, 2:]
    return total / np.maximum(find_lengths(total)[..., None], 1e-30)


def unfold(
    units: Float[np.ndarray, "R C 3"],
    is_movable: Bool[np.ndarray, "R C"] | None = None,
    iterations: int = MAX_UNFOLDINGS,
) -> Float[np.ndarray, "R C 3"]:
    """Move interior units whose cells turn over to the mean of their four neighbors, until none does."""
    units = units.copy()
    for _ in range(iterations):
        is_folded = find_folded(units)[1:-1, 1:-1]
        if is_movable is not None:
            is_folded &= is_movable[1:-1, 1:-1]
        if not is_folded.any():
            break
        mean = (units[:-2, 1:-1] + units[2:, 1:-1] + units[1:-1, :-2] + units[1:-1, 2:]) / 4
        units[1:-1, 1:-1][is_folded] = mean[is_folded]
    return units


def untangle_sheet(
    units: Float[np.ndarray, "R C 3"],
    has_face: Bool[np.ndarray, "R-1 C-1"],
    is_movable: Bool[np.ndarray, "R C"] | None = None,
) -> Float[np.ndarray, "R C 3"]:
    """Return the units, moved where the triangles of the sheet are folded or intersect."""
    for _ in range(MAX_SPLITS):
        vertices, faces = units.reshape(-1, 3), triangulate(units, has_face)
        if is_movable is None:
            moved = unfold_faces(vertices, faces)
        else:
            moved = unfold_part(vertices, faces, is_movable.reshape(-1))
        if moved is vertices:
            break
        units = moved.reshape(units.shape)
    return units


def find_folded(units: Float[np.ndarray, "R C 3"]) -> Bool[np.ndarray, "R C"]:
    """Return which units have a corner that turns against the surface around it."""
    rows, columns = units.shape[:2]
    normal = cell_normals(units)
    is_folded = np.zeros((rows, columns), dtype=bool)
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    at = [units[i : rows - 1 + i, j : columns - 1 + j] for i, j in corners]
    for k, (i, j) in enumerate(corners):
        corner = cross_rows(at[(k + 1) % 4] - at[k], at[(k - 1) % 4] - at[k])
        is_folded[i : rows - 1 + i, j : columns - 1 + j] |= sum_rows(corner * normal) < 0
    return is_folded


def _shape(
    vertices: Float[np.ndarray, "V 3"],
    i: Int[np.ndarray, "P Q"],
    j: Int[np.ndarray, "P Q"],
    k: Int[np.ndarray, "P Q"],
    normal: Float[np.ndarray, "P Q 3"],
) -> Float[np.ndarray, "P Q"]:
    """Return twice the area over the longest side squared, negative where the triangle is turned over."""
    p, q, r = vertices[i], vertices[j], vertices[k]
    area = sum_rows(cross_rows(q - p, r - p) * normal)
    longest = np.maximum(np.maximum(sum_rows((q - p) ** 2), sum_rows((r - q) ** 2)), sum_rows((p - r) ** 2))
    return area / np.maximum(longest, 1e-30)
