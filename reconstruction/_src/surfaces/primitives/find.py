"""From shapes to primitives: boxes of planes, closed spheres and cylinders, rectangles of the other planes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_smallest_rectangle
from reconstruction._src.surfaces.primitives.boxes import Side, Surface, propose_boxes
from reconstruction._src.surfaces.primitives.primitive import (
    APART,
    CELL,
    FEWEST,
    HOLLOW,
    MARGIN,
    MAX_OPEN,
    MAX_RECTANGLES,
    MIN_COVER,
    MIN_RECTANGLE,
    MIN_RECTANGLE_HOLLOW,
    REACH,
    THICKNESS,
    TOLERANCE_LIMITS,
    Primitive,
    PrimitivesConfig,
    take_out,
)
from reconstruction._src.surfaces.primitives.ransac import FoundShape, estimate_noise, find_shapes

_TRIMMED = 0.5  # Percentage of corners that may stick out of the rectangle that gives the direction
_MOST_CELLS = 500  # Cells of the grid along a side; wider ones are used beyond


class GridRectangle(NamedTuple):
    """A rectangle of cells: rows from `row` to `row_end`, columns likewise, the ends excluded."""

    row: int
    row_end: int
    column: int
    column_end: int


def find_rectangles(
    triangles: Float[np.ndarray, "F 3 2"],
    cell: float,
    least_area: float,
    most: int,
    is_backed: Callable[[np.ndarray], np.ndarray] | None = None,
    max_exposed: float = 0.0,
) -> list[tuple[Float[np.ndarray, " 2"], Float[np.ndarray, "2 2"], Float[np.ndarray, " 2"]]]:
    """Return rectangles that triangles cover, the largest first.

    A rectangle of covered cells grows over cells that are hidden, and over a few that are not.
    """
    around = find_smallest_rectangle(triangles.reshape(-1, 2), _TRIMMED)
    if around is None:
        return []
    turned = triangles @ around.axes
    low, high = turned.min(axis=(0, 1)), turned.max(axis=(0, 1))
    steps = np.clip(np.ceil((high - low) / cell), 1, _MOST_CELLS).astype(np.int64)
    lines = [np.linspace(low[k], high[k], steps[k] + 1) for k in range(2)]
    is_free = _find_covered(turned, lines)
    is_taken = np.zeros_like(is_free)
    is_exposed = ~is_free
    if is_backed is not None:
        middles = np.stack(
            np.meshgrid(*((line[1:] + line[:-1]) / 2 for line in lines), indexing="ij"), axis=-1
        )
        is_exposed[is_exposed] = ~is_backed(middles[is_exposed] @ around.axes.T)
    size = np.array([line[1] - line[0] for line in lines])
    found = []
    while len(found) < most:
        area, one = find_largest_rectangle(is_free)
        if area * float(size.prod()) < least_area:
            break
        one = _grow(one, is_exposed, is_taken, max_exposed)
        is_free[one.row : one.row_end, one.column : one.column_end] = False
        is_taken[one.row : one.row_end, one.column : one.column_end] = True
        first = np.array([lines[0][one.row], lines[1][one.column]])
        last = np.array([lines[0][one.row_end], lines[1][one.column_end]])
        found.append((around.axes @ (first + last) / 2, around.axes, (last - first) / 2))
    return found


def find_largest_rectangle(is_free: Bool[np.ndarray, "R C"]) -> tuple[int, GridRectangle]:
    """Return the number of cells of the largest rectangle of free cells, and where it is."""
    rows, columns = is_free.shape
    place = np.arange(columns)
    height, left, right = (
        np.zeros(columns, np.int64),
        np.zeros(columns, np.int64),
        np.full(columns, columns),
    )
    best, where = 0, GridRectangle(0, 0, 0, 0)
    for row in range(rows):
        free = is_free[row]
        height = np.where(free, height + 1, 0)
        begins = np.maximum.accumulate(np.where(free, 0, place + 1))
        ends = np.minimum.accumulate(np.where(free, columns, place)[::-1])[::-1]
        left = np.where(free, np.maximum(left, begins), 0)
        right = np.where(free, np.minimum(right, ends), columns)
        area = height * (right - left)
        k = int(np.argmax(area))
        if area[k] > best:
            best = int(area[k])
            where = GridRectangle(row + 1 - int(height[k]), row + 1, int(left[k]), int(right[k]))
    return best, where


def _grow(
    one: GridRectangle, is_exposed: Bool[np.ndarray, "R C"], is_taken: Bool[np.ndarray, "R C"], most: float
) -> GridRectangle:
    """Return a rectangle that is moved outwards, a row or column after the other, where that exposes the least.

    It ends where more than a share `most` of it would be exposed, and at cells that another rectangle has taken.
    """
    while True:
        wider = []
        for side, step in enumerate((-1, 1, -1, 1)):
            place = list(one)
            place[side] += step
            new = GridRectangle(*place)
            if min(new) < 0 or new.row_end > is_exposed.shape[0] or new.column_end > is_exposed.shape[1]:
                continue
            cells = slice(new.row, new.row_end), slice(new.column, new.column_end)
            share = float(is_exposed[cells].mean())
            if share <= most and not is_taken[cells].any():
                wider.append((share, side, new))
        if not wider:
            return one
        one = min(wider)[2]


def _find_covered(triangles: Float[np.ndarray, "F 3 2"], lines: list[np.ndarray]) -> Bool[np.ndarray, "R C"]:
    """Return which cells of a grid triangles cover at their corners and in their middle."""
    corners = np.concatenate([triangles, np.zeros((*triangles.shape[:2], 1))], axis=2)
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    ground = Elevation(mesh)
    nodes = np.isfinite(ground.height(*np.meshgrid(*lines, indexing="ij")))
    middles = [(line[1:] + line[:-1]) / 2 for line in lines]
    is_covered = np.isfinite(ground.height(*np.meshgrid(*middles, indexing="ij")))
    return is_covered & nodes[1:, 1:] & nodes[1:, :-1] & nodes[:-1, 1:] & nodes[:-1, :-1]


def split_rest(
    corners: Float[np.ndarray, "F 3 3"], primitives: list[Primitive], reach: float, apart: float, fewest: int
) -> list[Float[np.ndarray, "G 3 3"]]:
    """Divide triangles into those around each plane, and all others into groups that are apart.

    The tree of triangles of a whole room is hollow: a beam meets a box at each of its levels. Walls are flat parts, and
    furniture is small ones.
    """
    label = np.full(len(corners), -1)
    for number, plane in enumerate(primitives):
        if plane.kind == "plane":
            distance = np.abs((corners - plane.center) @ plane.axes[:, 2])
            is_near = (distance <= reach).all(axis=1) & (label < 0)
            if is_near.sum() >= fewest:
                label[is_near] = number
    walls = [corners[label == k] for k in np.unique(label[label >= 0])]
    others = corners[label < 0]
    return walls + (_split_by_place(others, apart, fewest) if len(others) else [])


def _split_by_place(
    corners: Float[np.ndarray, "F 3 3"], apart: float, fewest: int
) -> list[Float[np.ndarray, "G 3 3"]]:
    keys = np.floor(corners.mean(axis=1) / apart).astype(np.int64)
    cells, index = np.unique(keys, axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(1.0, p=np.inf, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(cells), len(cells)))
    label = connected_components(graph, directed=False)[1][index.ravel()]
    label = np.where(np.bincount(label)[label] >= fewest, label, -1)
    return [corners[label == k] for k in np.unique(label)]


_NOISES = 3.0  # Standard deviations of the noise that a vertex is off its shape at most


class Primitives(NamedTuple):
    """The primitives of a surface."""

    # boxes, spheres and cylinders first, then rectangles of planes, the largest first
    shapes: list[Primitive]
    tolerance: float  # how far what they replace may be off them [m]
    config: PrimitivesConfig  # how they were found

    def find_rest(self, mesh: trimesh.Trimesh) -> list[Float[np.ndarray, "F 3 3"]]:
        """Return the corners of the triangles that no primitive replaces [m], in parts."""
        corners = np.asarray(mesh.triangles, dtype=np.float64)
        for shape in self.shapes:
            corners = take_out(corners, shape, self.tolerance, MARGIN)
        if not len(corners):
            return []
        if not is_hollow(mesh):
            return [corners]
        return split_rest(corners, self.shapes, REACH, APART, FEWEST)


def is_hollow(mesh: trimesh.Trimesh) -> bool:
    """Return whether a surface is around free space, as a room, and not open ground."""
    x, y, z = mesh.extents
    return float(mesh.area) > HOLLOW * float(x * y + y * z + z * x)


def find_primitives(
    mesh: trimesh.Trimesh, config: PrimitivesConfig | None = None, seed: int = 0
) -> Primitives:
    """Find the planes, boxes, spheres and cylinders that replace triangles of a surface within its noise.

    References:
        Schnabel, Wahl and Klein (2007), Efficient RANSAC for point-cloud shape detection, Computer Graphics Forum
        26(2), the paper's reference 22.
    """
    config = config or PrimitivesConfig()
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if not len(faces) or not np.isfinite(vertices).all():
        raise ReconstructionError(
            f"primitives need a mesh with faces and finite vertices, got {len(faces)} faces; repair it first"
        )
    tolerance = config.tolerance
    if tolerance is None:
        tolerance = float(np.clip(_NOISES * estimate_noise(vertices, faces), *TOLERANCE_LIMITS))
    shapes = find_shapes(vertices, faces, tolerance, config, np.random.default_rng(seed))
    surface, corners = Surface(vertices, faces), vertices[faces]
    solids = []
    for shape in shapes:
        if shape.shape.kind != "plane":
            closed = _close(shape, corners)
            if surface.is_closed_by(closed, shape.area, tolerance):
                solids.append(closed)
    flat = [shape for shape in shapes if shape.shape.kind == "plane"]
    boxes, used = _find_boxes(flat, corners, surface, tolerance)
    share = MIN_RECTANGLE_HOLLOW if is_hollow(mesh) else MIN_RECTANGLE
    least = share * float(mesh.area)
    planes = [
        one
        for i, shape in enumerate(flat)
        if i not in used
        for one in _find_rectangles(
            shape,
            _leave_out([*boxes, *solids], corners[shape.faces], tolerance),
            least,
            surface,
            tolerance,
        )
    ]
    planes.sort(key=lambda one: -float(one.half_sizes[0] * one.half_sizes[1]))
    found = Primitives([*boxes, *solids, *planes], tolerance, config)
    left = sum(float(trimesh.triangles.area(part).sum()) for part in found.find_rest(mesh))
    if left > (1.0 - MIN_COVER) * float(mesh.area):
        return found._replace(shapes=[*boxes, *solids])
    return found


def _close(found: FoundShape, corners: Float[np.ndarray, "F 3 3"]) -> Primitive:
    """Return the sphere, or the cylinder between the ends of its faces."""
    shape = found.shape
    center, radius = shape.point[0], float(shape.radius[0])
    if shape.kind == "sphere":
        return Primitive("sphere", center, np.eye(3), np.array([radius, 0.0, 0.0]))
    axis = shape.axis[0]
    along = (corners[found.faces].reshape(-1, 3) - center) @ axis
    low, high = along.min(), along.max()
    size = np.array([radius, max(float(high - low) / 2, 1e-6), 0.0])
    return Primitive("cylinder", center + (low + high) / 2 * axis, _make_frame(axis), size)


def _find_boxes(
    flat: list[FoundShape],
    corners: Float[np.ndarray, "F 3 3"],
    surface: Surface,
    tolerance: float,
) -> tuple[list[Primitive], set[int]]:
    """Return the boxes that stand nowhere but where the surface is or behind it, and the planes that they use."""
    sides = [Side(shape.shape.axis[0], corners[shape.faces], shape.area) for shape in flat]
    edge = float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
    boxes: list[Primitive] = []
    used: set[int] = set()
    for box, members in propose_boxes(sides, edge):
        area = sum(sides[k].area for k in members)
        if not used & set(members) and surface.is_closed_by(box, area, tolerance):
            boxes.append(box)
            used |= set(members)
    return boxes, used


def _leave_out(
    solids: list[Primitive], corners: Float[np.ndarray, "F 3 3"], tolerance: float
) -> Float[np.ndarray, "G 3 3"]:
    """Return the triangles that no solid replaces."""
    for solid in solids:
        corners = corners[~solid.find_replaced(corners, tolerance)]
    return corners


def _find_rectangles(
    found: FoundShape,
    corners: Float[np.ndarray, "F 3 3"],
    least: float,
    surface: Surface,
    tolerance: float,
) -> list[Primitive]:
    """Return thin boxes behind the rectangles that the triangles of a plane cover."""
    if found.area < least or not len(corners):
        return []
    normal, point = found.shape.axis[0], found.shape.point[0]
    frame = _make_frame(normal)
    flat = ((corners - point) @ frame)[..., :2]

    def is_backed(places: Float[np.ndarray, "N 2"]) -> Bool[np.ndarray, " N"]:
        if not len(places):
            return np.zeros(0, bool)
        points = point + places @ frame[:, :2].T
        return surface.is_backed(points, np.broadcast_to(normal, points.shape), tolerance)

    planes = []
    for center, axes, half in find_rectangles(flat, CELL, least, MAX_RECTANGLES, is_backed, MAX_OPEN):
        turned = frame.copy()
        turned[:, :2] = frame[:, :2] @ axes
        depth = THICKNESS / 2
        place = point + frame[:, :2] @ center - depth * normal
        planes.append(Primitive("plane", place, turned, np.array([*half, depth])))
    return planes


def _make_frame(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return a right-handed frame (columns) whose z is an axis."""
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
