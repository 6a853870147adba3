"""A primitive: a bounded shape in place of triangles, and the cut that takes its triangles out of a mesh."""

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from reconstruction._src.geometry.rows import all_rows, any_rows, compute_lengths

Corners = Float[np.ndarray, "F 3 3"]  # Of triangles [m]

_LEAST_AREA = 1e-10  # Cut triangles with less area are left out [m²]
_MARGIN = 0.003
"""Triangles reach below the rim of a rectangle by this much [m], so that no beam slips through."""


class Primitive(NamedTuple):
    """A bounded shape."""

    kind: str  # "plane" (a rectangle, the front of a thin box), "box", "sphere" or "cylinder"
    center: Float[np.ndarray, " 3"]  # of the box, sphere or cylinder [m]
    axes: Float[np.ndarray, "3 3"]  # in columns; z is the normal of a plane's front, the axis of a cylinder
    # [m] of boxes; of spheres radius, 0, 0; of cylinders radius, half length, 0
    half_sizes: Float[np.ndarray, " 3"]

    @property
    def is_solid(self) -> bool:
        """Whether it is a body of its own; a plane is a rectangle of a surface."""
        return self.kind != "plane"

    def as_mesh(self) -> trimesh.Trimesh:
        """Return a closed mesh: exact for planes and boxes, 32 sides round a cylinder, 1280 faces on a sphere."""
        x, y, _ = self.half_sizes
        if self.kind == "sphere":
            mesh = trimesh.creation.icosphere(3, x)
        elif self.kind == "cylinder":
            mesh = trimesh.creation.cylinder(x, 2 * y, sections=32)
        else:
            mesh = trimesh.creation.box(2 * self.half_sizes)
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = self.axes, self.center
        return mesh.apply_transform(frame)

    def find_replaced(self, corners: Corners, tolerance: float) -> Bool[np.ndarray, " F"]:
        """Return which triangles lie on it wholly, within a tolerance [m]."""
        local, size = (corners - self.center) @ self.axes, self.half_sizes
        if self.kind == "sphere":
            return all_rows(np.abs(compute_lengths(local) - size[0]) <= tolerance)
        if self.kind == "cylinder":
            radius, height = compute_lengths(local[..., :2]), np.abs(local[..., 2])
            is_side = (np.abs(radius - size[0]) <= tolerance) & (height <= size[1] + tolerance)
            is_end = (np.abs(height - size[1]) <= tolerance) & (radius <= size[0] + tolerance)
            return all_rows(is_side) | all_rows(is_end)
        is_near = all_rows(np.abs(local) <= size + tolerance)
        if self.kind == "plane":
            return all_rows(is_near & (np.abs(local[..., 2] - size[2]) <= tolerance))
        on_side = np.abs(np.abs(local) - size) <= tolerance
        return any_rows(np.asarray((is_near[..., None] & on_side).all(axis=1)))


def take_out(
    corners: Corners, primitive: Primitive, tolerance: float, margin: float = _MARGIN
) -> Float[np.ndarray, "G 3 3"]:
    """Return triangles without what a primitive replaces; a rectangle cuts those that cross its rim."""
    if primitive.is_solid:
        return corners[~primitive.find_replaced(corners, tolerance)]
    local, size = (corners - primitive.center) @ primitive.axes, primitive.half_sizes
    normals = trimesh.triangles.cross(local)
    limits = size[:2] - margin
    is_on = all_rows(np.abs(local[..., 2] - size[2]) <= tolerance) & (normals[:, 2] > 0.0)
    is_on &= (local[..., :2].min(axis=1) < limits).all(axis=1)
    is_on &= (local[..., :2].max(axis=1) > -limits).all(axis=1)
    outside, inside = [corners[~is_on]], local[is_on]
    for axis, sign in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        direction = sign * np.eye(3)[axis]
        beyond = _cut(inside, direction, limits[axis] * direction)
        inside = _cut(inside, -direction, limits[axis] * direction)
        outside.append(beyond @ primitive.axes.T + primitive.center)
    return np.concatenate(outside)


def _cut(
    corners: Corners, direction: Float[np.ndarray, " 3"], origin: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "G 3 3"]:
    """Return the part of triangles that lies beyond a plane."""
    if not len(corners):
        return corners
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    sliced = trimesh.intersections.slice_faces_plane(corners.reshape(-1, 3), faces, direction, origin)
    found = np.asarray(sliced[0])[np.asarray(sliced[1], dtype=np.int64)].reshape(-1, 3, 3)
    return found[trimesh.triangles.area(found) > _LEAST_AREA]
