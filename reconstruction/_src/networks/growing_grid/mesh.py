"""The triangles of a grid of units: which diagonal splits a cell, and how folds are taken out."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import Faces, Vertices, compute_lengths, cross_rows, sum_rows
from reconstruction._src.surfaces.unfolding import unfold_faces

Grid = Float[np.ndarray, "R C 3"]  # Reference vectors
Cells = Int[np.ndarray, "P Q"]  # Numbers

MAX_UNFOLDINGS = 6
"""Passes that take folds out; few folds need more than two, and the rest is taken out as triangles."""
MAX_SPLITS = 4
"""Moved units may split cells across other diagonals; the result is tested again at most this many times."""


def triangulate(units: Grid, has_face: Bool[np.ndarray, "R-1 C-1"]) -> Faces:
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


def cell_normals(units: Grid) -> Float[np.ndarray, "R-1 C-1 3"]:
    """Return a unit normal for every cell, the mean over the 3 x 3 cells around it."""
    across = cross_rows(units[1:, 1:] - units[:-1, :-1], units[:-1, 1:] - units[1:, :-1])
    wide = np.pad(across, ((1, 1), (0, 0), (0, 0)))
    wide = np.pad(wide[:-2] + wide[1:-1] + wide[2:], ((0, 0), (1, 1), (0, 0)))
    total = wide[:, :-2] + wide[:, 1:-1] + wide[:, 2:]
    return total / np.maximum(compute_lengths(total)[..., None], 1e-30)


def unfold(units: Grid, is_movable: Bool[np.ndarray, "R C"] | None = None) -> Grid:
    """Move interior units whose cells turn over to the mean of their four neighbors, until none does."""
    units = units.copy()
    for _ in range(MAX_UNFOLDINGS):
        is_folded = find_folded(units)[1:-1, 1:-1]
        if is_movable is not None:
            is_folded &= is_movable[1:-1, 1:-1]
        if not is_folded.any():
            break
        mean = (units[:-2, 1:-1] + units[2:, 1:-1] + units[1:-1, :-2] + units[1:-1, 2:]) / 4
        units[1:-1, 1:-1][is_folded] = mean[is_folded]
    return units


def untangle_sheet(
    units: Grid, has_face: Bool[np.ndarray, "R-1 C-1"], is_movable: Bool[np.ndarray, "R C"] | None = None
) -> Grid:
    """Return the units, moved where the triangles of the sheet are folded or intersect."""
    for _ in range(MAX_SPLITS):
        vertices, faces = units.reshape(-1, 3), triangulate(units, has_face)
        moved, _ = unfold_faces(vertices, faces, None if is_movable is None else is_movable.reshape(-1))
        if moved is vertices:
            break
        units = moved.reshape(units.shape)
    return units


def find_folded(units: Grid) -> Bool[np.ndarray, "R C"]:
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
    vertices: Vertices, i: Cells, j: Cells, k: Cells, normal: Float[np.ndarray, "P Q 3"]
) -> Float[np.ndarray, "P Q"]:
    """Return twice the area over the longest side squared, negative where the triangle is turned over."""
    p, q, r = vertices[i], vertices[j], vertices[k]
    area = sum_rows(cross_rows(q - p, r - p) * normal)
    longest = np.maximum(np.maximum(sum_rows((q - p) ** 2), sum_rows((r - q) ** 2)), sum_rows((p - r) ** 2))
    return area / np.maximum(longest, 1e-30)


_PLACES = np.array([0.2, 0.5, 0.8])  # Along each side of a cell: nine places spread evenly over it


_STRETCH = 2.0
"""Only cells with a side longer than this many median sides are tested: where there are points, units are,
too."""
_MAX_VOID = 0.5  # A cell of which a larger share lies far from all points is no surface
_NUM_NEAR = 10  # Neighbors in the ball that measures the spacing of the points


def find_covered_cells(units: Grid, tree: cKDTree) -> Bool[np.ndarray, "R-1 C-1"]:
    """Return which cells belong to the surface: not those drawn out over a hole without points, given their tree."""
    down = compute_lengths(np.diff(units, axis=0))
    across = compute_lengths(np.diff(units, axis=1))
    sides = np.stack([down[:, :-1], down[:, 1:], across[:-1], across[1:]])
    longest, typical = sides.max(axis=0), float(np.median(sides))
    is_covered = longest <= _STRETCH * typical
    row, column = np.nonzero(~is_covered)
    if len(row) == 0:
        return is_covered
    s, t = (a.ravel()[:, None, None] for a in np.meshgrid(_PLACES, _PLACES))
    upper = (1 - t) * units[row, column] + t * units[row, column + 1]
    lower = (1 - t) * units[row + 1, column] + t * units[row + 1, column + 1]
    places = (1 - s) * upper + s * lower
    distances, nearest = tree.query(places)
    is_void = distances > typical
    spacing = tree.query(tree.data[nearest[is_void]], k=[min(_NUM_NEAR, tree.n - 1) + 1])[0][:, 0]
    is_void[is_void] = distances[is_void] > spacing
    is_covered[row, column] = is_void.mean(axis=0) < _MAX_VOID
    return open_pinches(is_covered)


def open_pinches(has_face: Bool[np.ndarray, "P Q"]) -> Bool[np.ndarray, "P Q"]:
    """Return the cells without those that touch another only at a corner, so that no vertex is pinched."""
    has_face = has_face.copy()
    while True:
        a, b, c, d = has_face[:-1, :-1], has_face[1:, :-1], has_face[1:, 1:], has_face[:-1, 1:]
        pinch_ac, pinch_bd = a & c & ~b & ~d, b & d & ~a & ~c
        if not (pinch_ac.any() or pinch_bd.any()):
            return has_face
        has_face[:-1, :-1] &= ~pinch_ac
        has_face[1:, :-1] &= ~pinch_bd
