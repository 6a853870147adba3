"""From shapes to primitives: boxes of planes, closed spheres and cylinders, rectangles of the other planes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.surfaces.primitives.boxes import Side, propose_boxes
from reconstruction._src.surfaces.primitives.chunks import split_rest
from reconstruction._src.surfaces.primitives.config import PrimitivesConfig
from reconstruction._src.surfaces.primitives.exposure import Surface
from reconstruction._src.surfaces.primitives.primitive import Primitive, take_out
from reconstruction._src.surfaces.primitives.ransac import FoundShape, estimate_noise, find_shapes
from reconstruction._src.surfaces.primitives.rectangles import find_rectangles

_NOISES = 3.0
"""Standard deviations of the noise that a vertex is off its shape at most."""


class Primitives(NamedTuple):
    """The primitives of a surface.

    Attributes:
        shapes: boxes, spheres and cylinders first, then rectangles of planes, the largest first.
        tolerance: how far what they replace may be off them [m].
        config: how they were found.
    """

    shapes: list[Primitive]
    tolerance: float
    config: PrimitivesConfig

    def find_rest(self, mesh: trimesh.Trimesh) -> list[Float[np.ndarray, "F 3 3"]]:
        """Return the corners of the triangles that no primitive replaces [m], in parts."""
        corners = np.asarray(mesh.triangles, dtype=np.float64)
        for shape in self.shapes:
            corners = take_out(corners, shape, self.tolerance, self.config.margin)
        if not len(corners):
            return []
        config = self.config
        if not is_hollow(mesh, config):
            return [corners]
        return split_rest(corners, self.shapes, config.reach, config.apart, config.fewest)


def is_hollow(mesh: trimesh.Trimesh, config: PrimitivesConfig) -> bool:
    """Return whether a surface is around free space, as a room, and not open ground."""
    x, y, z = mesh.extents
    return float(mesh.area) > config.hollow * float(x * y + y * z + z * x)


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
        tolerance = float(np.clip(_NOISES * estimate_noise(vertices, faces), *config.tolerance_limits))
    shapes = find_shapes(vertices, faces, tolerance, config, np.random.default_rng(seed))
    surface, corners = Surface(vertices, faces), vertices[faces]
    solids = []
    for shape in shapes:
        if shape.shape.kind != "plane":
            closed = _close(shape, corners)
            if surface.is_closed_by(closed, shape.area, tolerance, config):
                solids.append(closed)
    flat = [shape for shape in shapes if shape.shape.kind == "plane"]
    boxes, used = _find_boxes(flat, corners, surface, tolerance, config)
    share = config.min_rectangle_hollow if is_hollow(mesh, config) else config.min_rectangle
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
            config,
        )
    ]
    planes.sort(key=lambda one: -float(one.half_sizes[0] * one.half_sizes[1]))
    found = Primitives([*boxes, *solids, *planes], tolerance, config)
    left = sum(float(trimesh.triangles.area(part).sum()) for part in found.find_rest(mesh))
    if left > (1.0 - config.min_cover) * float(mesh.area):
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
    config: PrimitivesConfig,
) -> tuple[list[Primitive], set[int]]:
    """Return the boxes that stand nowhere but where the surface is or behind it, and the planes that they use."""
    sides = [Side(shape.shape.axis[0], corners[shape.faces], shape.area) for shape in flat]
    edge = float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
    boxes: list[Primitive] = []
    used: set[int] = set()
    for box, members in propose_boxes(sides, edge):
        area = sum(sides[k].area for k in members)
        if not used & set(members) and surface.is_closed_by(box, area, tolerance, config):
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
    config: PrimitivesConfig,
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
    for center, axes, half in find_rectangles(
        flat, config.cell, least, config.max_rectangles, is_backed, config.max_open
    ):
        turned = frame.copy()
        turned[:, :2] = frame[:, :2] @ axes
        depth = config.thickness / 2
        place = point + frame[:, :2] @ center - depth * normal
        planes.append(Primitive("plane", place, turned, np.array([*half, depth])))
    return planes


def _make_frame(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return a right-handed frame (columns) whose z is an axis."""
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
