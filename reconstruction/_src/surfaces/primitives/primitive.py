"""A primitive: a bounded shape in place of triangles, and the cut that takes its triangles out of a mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float

_LEAST_AREA = 1e-10
"""Cut triangles with less area are left out [m²]."""


class Primitive(NamedTuple):
    """A bounded shape.

    Attributes:
        kind: "plane" (a rectangle, the front of a thin box), "box", "sphere" or "cylinder".
        center: of the box, sphere or cylinder [m].
        axes: its axes as columns; z is the normal of a plane's front and the axis of a cylinder.
        half_sizes: of boxes; radius of spheres; radius and half length of cylinders; else 0 [m].
    """

    kind: str
    center: Float[np.ndarray, " 3"]
    axes: Float[np.ndarray, "3 3"]
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

    def find_replaced(self, corners: Float[np.ndarray, "F 3 3"], tolerance: float) -> Bool[np.ndarray, " F"]:
        """Return which triangles lie on it wholly, within a tolerance [m]."""
        local = (corners - self.center) @ self.axes
        size = self.half_sizes
        if self.kind == "sphere":
            return (np.abs(np.linalg.norm(local, axis=2) - size[0]) <= tolerance).all(axis=1)
        if self.kind == "cylinder":
            radius, height = np.linalg.norm(local[..., :2], axis=2), np.abs(local[..., 2])
            is_side = (np.abs(radius - size[0]) <= tolerance) & (height <= size[1] + tolerance)
            is_end = (np.abs(height - size[1]) <= tolerance) & (radius <= size[0] + tolerance)
            return is_side.all(axis=1) | is_end.all(axis=1)
        off = np.abs(local)
        is_near = (off <= size + tolerance).all(axis=2)
        if self.kind == "plane":
            return (is_near & (np.abs(local[..., 2] - size[2]) <= tolerance)).all(axis=1)
        on_side = np.abs(off - size) <= tolerance
        return np.any(np.all(np.asarray(is_near)[..., None] & on_side, axis=1), axis=1)


def take_out(
    corners: Float[np.ndarray, "F 3 3"], primitive: Primitive, tolerance: float, margin: float
) -> Float[np.ndarray, "G 3 3"]:
    """Return triangles without what a primitive replaces; a rectangle cuts those that cross its rim."""
    if primitive.kind != "plane":
        return corners[~primitive.find_replaced(corners, tolerance)]
    local = (corners - primitive.center) @ primitive.axes
    size = primitive.half_sizes
    is_on = (np.abs(local[..., 2] - size[2]) <= tolerance).all(axis=1)
    is_on &= _find_normals(corners) @ primitive.axes[:, 2] > 0.0
    limits = size[:2] - margin
    is_on &= (local[..., :2].min(axis=1) < limits).all(axis=1) & (local[..., :2].max(axis=1) > -limits).all(
        axis=1
    )
    outside, inside = [corners[~is_on]], local[is_on]
    for axis in range(2):
        for sign in (-1.0, 1.0):
            beyond, inside = _split(inside, sign * inside[..., axis] - limits[axis])
            outside.append(beyond @ primitive.axes.T + primitive.center)
    return np.concatenate(outside)


def _split(
    corners: Float[np.ndarray, "F 3 3"], height: Float[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, "A 3 3"], Float[np.ndarray, "B 3 3"]]:
    """Cut triangles where a linear height is 0; return those above and those below."""
    above, below = [corners[(height >= 0).all(axis=1)]], [corners[(height < 0).all(axis=1)]]
    is_cut = (height >= 0).any(axis=1) & (height < 0).any(axis=1)
    corners, height = corners[is_cut], height[is_cut]
    is_lone_above = (height >= 0).sum(axis=1) == 1
    lone = np.where(is_lone_above, np.argmax(height >= 0, axis=1), np.argmax(height < 0, axis=1))
    row = np.arange(len(corners))
    a, b, c = (corners[row, (lone + k) % 3] for k in range(3))
    ha, hb, hc = (height[row, (lone + k) % 3] for k in range(3))
    p = a + (ha / (ha - hb))[:, None] * (b - a)
    q = a + (ha / (ha - hc))[:, None] * (c - a)
    tip, rest = np.stack([a, p, q], axis=1), [np.stack([p, b, c], axis=1), np.stack([p, c, q], axis=1)]
    above += [tip[is_lone_above], *(part[~is_lone_above] for part in rest)]
    below += [tip[~is_lone_above], *(part[is_lone_above] for part in rest)]
    return _drop_flat(np.concatenate(above)), _drop_flat(np.concatenate(below))


def _drop_flat(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, "G 3 3"]:
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners[np.linalg.norm(crossed, axis=1) / 2 > _LEAST_AREA]


def _find_normals(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, "F 3"]:
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-300)
