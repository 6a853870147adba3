"""From shapes to primitives: boxes of planes, closed spheres and cylinders, rectangles of the other planes."""

from itertools import combinations
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_smallest_rectangle
from reconstruction._src.geometry.manifold import find_border_vertices
from reconstruction._src.geometry.outlines import find_largest_rectangle
from reconstruction._src.geometry.rows import Faces, Vertices, compute_lengths, sum_rows
from reconstruction._src.geometry.sampling import sample_surface
from reconstruction._src.surfaces.primitives.primitive import Corners, Primitive, take_out
from reconstruction._src.surfaces.primitives.ransac import FoundShape, estimate_noise, find_shapes, make_frame

_NOISES = 3.0  # Standard deviations of the noise that a vertex is off its shape at most
_TOLERANCE_LIMITS = (0.004, 0.006)
"""Of the tolerance [m]: beams on a shape are off those on the mesh by a quarter of it in the mean; less leaves holes in
planes, which rectangles must go around."""
_MIN_COVERED = 0.3  # Share of a closed shape (box, sphere, cylinder) that faces cover, at least
_MAX_EXPOSED = 0.02  # Share of a closed shape that may stand where the surface says nothing
_SAMPLES = 2000  # Points on a shape at which that is looked at
_ON = 2.0  # A point lies on the surface within so many tolerances
_RIGHT = 0.07  # Sine of the angle by which two sides may be off a right angle, or a side off its axis
_NEAR = 4.0  # Sides are neighbors whose faces come nearer than so many typical edges
_TRIMMED = 1.0  # Percentile of corners at which a box ends where no side was found
_THINNEST = 1e-6  # Half a side of a box at least [m]
_MIN_RECTANGLE = 0.02  # Share of the surface that a rectangle of a plane has at least: each costs every beam
_MAX_RECTANGLES = 6  # Of one plane, the largest first
_OUTSIDE = 0.5  # Percentage of corners that may stick out of the rectangle that gives the direction
_CELL = 0.01  # Resolution at which a plane is divided into rectangles [m]
_MOST_CELLS = 500  # Cells of the grid along a side; wider ones are used beyond
_THICKNESS = 0.004  # Of the box behind a rectangle [m], away from free space
_REACH = 0.2  # The rest is divided into what is this near to each plane [m], and all others ...
_FEWEST = 30  # ... each of so many triangles at least


class Primitives(NamedTuple):
    """The primitives of a surface."""

    # boxes, spheres and cylinders first, then rectangles of planes, the largest first
    shapes: list[Primitive]
    tolerance: float  # how far what they replace may be off them [m]

    def find_rest(self, mesh: trimesh.Trimesh) -> list[Corners]:
        """Return the corners of the triangles that no primitive replaces [m], in parts.

        Those near one plane are a part: the tree of triangles of a whole room is hollow, a beam meets a box at each of
        its levels; walls are flat.
        """
        corners = np.asarray(mesh.triangles, dtype=np.float64)
        for shape in self.shapes:
            corners = take_out(corners, shape, self.tolerance)
        parts = []
        for plane in (shape for shape in self.shapes if not shape.is_solid):
            distance = np.abs((corners - plane.center) @ plane.axes[:, 2])
            is_near = (distance <= _REACH).all(axis=1)
            if is_near.sum() >= _FEWEST:
                parts.append(corners[is_near])
                corners = corners[~is_near]
        return [*parts, corners] if len(corners) else parts


class _Side(NamedTuple):
    """A plane that was found."""

    normal: Float[np.ndarray, " 3"]  # into free space
    corners: Corners  # of its faces
    area: float  # [m²]

    @property
    def middle(self) -> Float[np.ndarray, " 3"]:
        return self.corners.mean(axis=(0, 1))

    def is_convex_with(self, other: "_Side") -> bool:
        """Return whether each of two sides lies behind the other."""
        way = other.middle - self.middle
        return bool(way @ self.normal < 0 < way @ other.normal)


def find_primitives(mesh: trimesh.Trimesh, seed: int = 0) -> Primitives:
    """Find the planes, boxes, spheres and cylinders that replace triangles of a surface within its noise."""
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if not len(faces) or not np.isfinite(vertices).all():
        raise ReconstructionError(
            f"primitives need a mesh with faces and finite vertices, got {len(faces)} faces; repair it first"
        )
    tolerance = float(np.clip(_NOISES * estimate_noise(vertices, faces), *_TOLERANCE_LIMITS))
    shapes = find_shapes(vertices, faces, tolerance, np.random.default_rng(seed))
    corners = vertices[faces]
    flat = [shape for shape in shapes if shape.shape.kind == "plane"]
    sides = [_Side(shape.shape.axis[0], corners[shape.faces], shape.area) for shape in flat]
    edge = float(np.median(compute_lengths(corners - np.roll(corners, 1, axis=1))))
    solids, used = [], set()
    for box, members in _propose_boxes(sides, edge):
        area = sum(sides[k].area for k in members)
        if not used & set(members) and _is_closed(box, area, vertices, faces, tolerance):
            solids.append(box)
            used |= set(members)
    for shape in shapes:
        if shape.shape.kind != "plane":
            closed = _close(shape, corners)
            if _is_closed(closed, shape.area, vertices, faces, tolerance):
                solids.append(closed)
    planes = []
    for side in (side for k, side in enumerate(sides) if k not in used):
        left = side.corners
        for solid in solids:
            left = left[~solid.find_replaced(left, tolerance)]
        planes += _make_rectangles(side.normal, left, _MIN_RECTANGLE * float(mesh.area))
    planes.sort(key=lambda one: -float(one.half_sizes[0] * one.half_sizes[1]))
    return Primitives([*solids, *planes], tolerance)


def _close(found: FoundShape, corners: Corners) -> Primitive:
    center, axis, radius = found.shape.point[0], found.shape.axis[0], float(found.shape.radius[0])
    if found.shape.kind == "sphere":
        return Primitive("sphere", center, np.eye(3), np.array([radius, 0.0, 0.0]))
    along = (corners[found.faces].reshape(-1, 3) - center) @ axis
    low, high = along.min(), along.max()
    size = np.array([radius, max(float(high - low) / 2, _THINNEST), 0.0])
    return Primitive("cylinder", center + (low + high) / 2 * axis, make_frame(axis), size)


def _is_closed(shape: Primitive, area: float, vertices: Vertices, faces: Faces, tolerance: float) -> bool:
    """Return whether faces cover enough of a closed shape, and nearly all of it lies on the surface or behind it.

    A point whose nearest place of the surface is at the rim, where the surface ends, is not behind it.
    """
    import igl

    mesh = shape.as_mesh()
    if area < _MIN_COVERED * float(mesh.area):
        return False
    points, index = sample_surface(mesh, _SAMPLES, 0)
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    distance, nearest, _, normals = (
        np.asarray(part) for part in igl.signed_distance(points, vertices, faces, kind)
    )
    is_rim = find_border_vertices(faces, len(vertices))
    looks_alike = sum_rows(np.asarray(mesh.face_normals)[index] * normals) > 0
    is_on = (np.abs(distance) <= _ON * tolerance) & looks_alike
    is_behind = (distance < 0) & (is_rim[faces[nearest]].sum(axis=1) < 2)
    return bool((is_on | is_behind).mean() >= 1.0 - _MAX_EXPOSED)


def _propose_boxes(sides: list[_Side], edge: float) -> list[tuple[Primitive, tuple[int, ...]]]:
    """Return the boxes that pairs of sides at right angles propose, the largest area first, with their sides."""
    trees = [cKDTree(side.corners.reshape(-1, 3)) for side in sides]
    near = np.zeros((len(sides), len(sides)), dtype=bool)
    for i, j in combinations(range(len(sides)), 2):
        near[i, j] = near[j, i] = np.isfinite(
            trees[i].query(trees[j].data, distance_upper_bound=_NEAR * edge)[0]
        ).any()
    found: dict[tuple[int, ...], tuple[float, Primitive]] = {}
    for i, j in combinations(range(len(sides)), 2):
        one, other = sides[i], sides[j]
        if not near[i, j] or abs(one.normal @ other.normal) > _RIGHT or not one.is_convex_with(other):
            continue
        y = other.normal - (one.normal @ other.normal) * one.normal
        y = y / np.linalg.norm(y)
        axes = np.column_stack([one.normal, y, np.cross(one.normal, y)])
        members = [i, j]
        for k, side in enumerate(sides):
            is_aligned = np.abs(side.normal @ axes).max() > 1.0 - _RIGHT**2
            is_part = k not in members and is_aligned and (near[k, i] or near[k, j])
            if is_part and all(
                side.normal @ sides[m].normal < 0.5 and side.is_convex_with(sides[m]) for m in members
            ):
                members.append(k)
        key = tuple(sorted(members))
        if key not in found:
            found[key] = sum(sides[k].area for k in key), _enclose([sides[k] for k in key], axes)
    ranked = sorted(found.items(), key=lambda item: (-item[1][0], item[0]))
    return [(box, key) for key, (_, box) in ranked]


def _enclose(sides: list[_Side], axes: Float[np.ndarray, "3 3"]) -> Primitive:
    """Return the box between sides; where there is none, it ends with the others."""
    local = np.concatenate([side.corners.reshape(-1, 3) for side in sides]) @ axes
    low, high = np.percentile(local, [_TRIMMED, 100.0 - _TRIMMED], axis=0)
    for side in sides:
        toward = side.normal @ axes
        axis = int(np.argmax(np.abs(toward)))
        (high if toward[axis] > 0 else low)[axis] = side.middle @ axes[:, axis]
    return Primitive("box", axes @ ((low + high) / 2), axes, np.maximum((high - low) / 2, _THINNEST))


def _make_rectangles(normal: Float[np.ndarray, " 3"], corners: Corners, least: float) -> list[Primitive]:
    """Return thin boxes behind the rectangles that the triangles of a plane cover, of at least an area [m²]."""
    if not len(corners):
        return []
    frame = make_frame(normal)
    local = corners @ frame
    depth = float(local[..., 2].mean()) - _THICKNESS / 2
    planes = []
    for center, axes, half in find_rectangles(local[..., :2], _CELL, least, _MAX_RECTANGLES):
        turned = frame.copy()
        turned[:, :2] = frame[:, :2] @ axes
        place = frame @ np.array([*center, depth])
        planes.append(Primitive("plane", place, turned, np.array([*half, _THICKNESS / 2])))
    return planes


def find_rectangles(
    triangles: Float[np.ndarray, "F 3 2"], cell: float, least_area: float, most: int
) -> list[tuple[Float[np.ndarray, " 2"], Float[np.ndarray, "2 2"], Float[np.ndarray, " 2"]]]:
    """Return center, axes and half sizes of rectangles that triangles cover, the largest first."""
    around = find_smallest_rectangle(triangles.reshape(-1, 2), _OUTSIDE)
    if around is None:
        return []
    turned = triangles @ around.axes
    low, high = turned.min(axis=(0, 1)), turned.max(axis=(0, 1))
    steps = np.clip(np.ceil((high - low) / cell), 1, _MOST_CELLS).astype(np.int64)
    lines = [np.linspace(low[k], high[k], steps[k] + 1) for k in range(2)]
    is_free = _find_covered(turned, lines)
    size = (high - low) / steps
    found = []
    while len(found) < most:
        row, column, row_end, column_end = find_largest_rectangle(is_free)
        if (row_end - row) * (column_end - column) * float(size.prod()) < max(least_area, size.prod()):
            break
        is_free[row:row_end, column:column_end] = False
        first = np.array([lines[0][row], lines[1][column]])
        last = np.array([lines[0][row_end], lines[1][column_end]])
        found.append((around.axes @ (first + last) / 2, around.axes, (last - first) / 2))
    return found


def _find_covered(triangles: Float[np.ndarray, "F 3 2"], lines: list[np.ndarray]) -> Bool[np.ndarray, "R C"]:
    """Return which cells of a grid triangles cover at their corners and in their middle."""
    corners = np.concatenate([triangles, np.zeros((*triangles.shape[:2], 1))], axis=2)
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    ground = Elevation(mesh)
    nodes = np.isfinite(ground.height(*np.meshgrid(*lines, indexing="ij")))
    middles = [(line[1:] + line[:-1]) / 2 for line in lines]
    is_covered = np.isfinite(ground.height(*np.meshgrid(*middles, indexing="ij")))
    return is_covered & nodes[1:, 1:] & nodes[1:, :-1] & nodes[:-1, 1:] & nodes[:-1, :-1]
