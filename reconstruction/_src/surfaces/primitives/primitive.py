"""A primitive: a bounded shape in place of triangles, and the cut that takes its triangles out of a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.optimize import least_squares

from reconstruction._src.base.range_checks import check_all_positive

_LEAST_AREA = 1e-10  # Cut triangles with less area are left out [m²]


class Primitive(NamedTuple):
    """A bounded shape."""

    kind: str  # "plane" (a rectangle, the front of a thin box), "box", "sphere" or "cylinder"
    center: Float[np.ndarray, " 3"]  # of the box, sphere or cylinder [m]
    # its axes as columns; z is the normal of a plane's front and the axis of a cylinder
    axes: Float[np.ndarray, "3 3"]
    # of boxes; radius of spheres; radius and half length of cylinders; else 0 [m]
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
    is_on &= _compute_normals(corners) @ primitive.axes[:, 2] > 0.0
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


def _compute_normals(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, "F 3"]:
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-300)


TOLERANCE_LIMITS = (0.004, 0.006)
"""Of an estimated tolerance [m]. Beams on a shape are off those on the mesh by a quarter of the tolerance in
the mean."""
NORMAL_ANGLE = 0.35
"""Largest angle between a face and its shape [rad]: normals of faces of 3 cm with a noise of 1 mm deviate by
4 degrees."""
MIN_PART = 0.003  # Share of the surface that a shape has at least; smaller ones stay triangles
MIN_COVERED = 0.3  # Share of a closed shape (box, sphere, cylinder) that faces cover, at least
MAX_EXPOSED = 0.02  # Share of a closed shape that may stand where the surface says nothing
MAX_OPEN = 0.01
"""Share of a rectangle that neither lies on the surface nor behind it, at most. Rectangles grow to the
corners of a room and behind things that stand before them, so that little is left for the tree of triangles,
and over ragged rims. More closes narrow openings: 0.02 closed half a doorway."""
MIN_RECTANGLE = 0.06
"""Share of the surface that a rectangle of a plane has at least, where the surface is open ground: each costs
every beam that looks its way, as much as a level or two of the tree of triangles ..."""
MIN_RECTANGLE_HOLLOW = 0.02
"""... and where it is hollow, as a room, of which each beam meets more boxes of the tree."""
HOLLOW = 1.5  # A surface is hollow with more area than this, relative to half that of the box around it
MIN_COVER = 0.6
"""Share of the surface that rectangles and solids have together, or rectangles are left out: where most beams
go through the tree all the same, they only cost."""
MAX_RECTANGLES = 6  # Of one plane, the largest first
CELL = 0.01  # Resolution at which a plane is divided into rectangles [m]
MARGIN = 0.003  # Triangles reach below the rim of a rectangle by this much [m], so that no beam slips through
THICKNESS = 0.004  # Of the box behind a rectangle [m], away from free space
REACH = 0.2  # The rest of a hollow surface is divided into what is this near to each plane [m] ..
APART = 0.3  # ... and all others into groups that are this far apart [m], ...
FEWEST = 30  # ... each of so many triangles at least.
CANDIDATES = 200  # Drawn in a round, of each kind
SAMPLE = 1500  # Faces on which candidates are compared
MISSES = 3  # Rounds without a shape after which the search ends
FITS = 4  # Rounds of fitting a shape to the faces that it explains


@dataclass(frozen=True)
class PrimitivesConfig:
    """Which shapes replace triangles.

    Raises:
    """

    # largest distance of a replaced vertex from its shape [m]; None: three times the noise of the surface,
    # within `tolerance_limits`. Less leaves holes in planes, which rectangles must go around.
    tolerance: float | None = None
    min_area: float = 0.03  # of the faces of a shape [m²]; smaller ones stay triangles ..
    max_radius: float = 1.0  # of spheres and cylinders [m]; larger ones are hardly told from planes

    def __post_init__(self) -> None:
        check_all_positive(self)


KINDS = ("plane", "sphere", "cylinder")
_LEAST = 1e-9  # Divided by instead of 0


class Shapes(NamedTuple):
    """Several infinite shapes of one kind."""

    kind: str  # one of `KINDS`
    point: Float[np.ndarray, "C 3"]  # a point of the plane, the center, a point of the axis [m]
    axis: Float[np.ndarray, "C 3"]  # unit normal of the plane, axis of the cylinder; unused by spheres
    radius: Float[np.ndarray, " C"]  # of sphere or cylinder [m]; unused by planes
    # 1 where the surface looks outwards, away from center or axis, -1 inwards; 1 for planes
    side: Float[np.ndarray, " C"]

    def pick(self, index: int) -> Shapes:
        """Return one of them."""
        one = slice(index, index + 1)
        return Shapes(self.kind, *(array[one] for array in self[1:]))

    def measure(
        self, points: Float[np.ndarray, "N 3"]
    ) -> tuple[Float[np.ndarray, "C N"], Float[np.ndarray, "C N 3"]]:
        """Return the signed distance of points in front of each shape [m], and the shape's normals there."""
        offset = points[None] - self.point[:, None]
        if self.kind == "plane":
            distance = np.einsum("cnk,ck->cn", offset, self.axis)
            return distance, np.broadcast_to(self.axis[:, None], offset.shape)
        if self.kind == "cylinder":
            along = np.einsum("cnk,ck->cn", offset, self.axis)
            offset = offset - along[..., None] * self.axis[:, None]
        length = np.linalg.norm(offset, axis=2)
        normals = self.side[:, None, None] * offset / np.maximum(length, _LEAST)[..., None]
        return self.side[:, None] * (length - self.radius[:, None]), normals


def make_candidates(
    kind: str,
    points: Float[np.ndarray, "C 2 3"],
    normals: Float[np.ndarray, "C 2 3"],
    max_radius: float,
) -> Shapes:
    """Return the shapes through minimal sets: two oriented points each.

    References:
        Schnabel, Wahl and Klein (2007), Efficient RANSAC for point-cloud shape detection, section 4.1.
        Differs: a plane is made of two oriented points, not of three points.
    """
    (p, q), (n, m) = np.moveaxis(points, 1, 0), np.moveaxis(normals, 1, 0)
    if kind == "plane":
        axis = _normalize(n + m)
        return Shapes(kind, (p + q) / 2, axis, np.zeros(len(p)), np.ones(len(p)))
    axis = _normalize(np.cross(n, m)) if kind == "cylinder" else np.zeros_like(p)
    apart = q - p
    apart = apart - (np.einsum("ck,ck->c", apart, axis))[:, None] * axis
    # the lines p + s n and q + t m, across the axis, come nearest to each other at the center
    cosine = np.einsum("ck,ck->c", n, m)
    a, b = np.einsum("ck,ck->c", n, apart), np.einsum("ck,ck->c", m, apart)
    sine = np.maximum(1.0 - cosine**2, _LEAST)
    s, t = (a - cosine * b) / sine, (cosine * a - b) / sine
    center = (p + s[:, None] * n + p + apart + t[:, None] * m) / 2
    radius = (np.abs(s) + np.abs(t)) / 2
    is_good = (s * t > 0) & (radius < max_radius) & (np.abs(np.abs(s) - np.abs(t)) < 0.3 * radius)
    is_good &= sine > 0.03
    return Shapes(kind, center[is_good], axis[is_good], radius[is_good], -np.sign(s[is_good]))


def fit_shape(shape: Shapes, points: Float[np.ndarray, "N 3"], weights: Float[np.ndarray, " N"]) -> Shapes:
    """Return the shape that fits points best in the sense of least squares, from a first guess."""
    weights = weights / weights.sum()
    if shape.kind == "plane":
        center = weights @ points
        offset = (points - center) * np.sqrt(weights)[:, None]
        axis = np.linalg.svd(offset, full_matrices=False)[2][2]
        axis = axis * np.sign(axis @ shape.axis[0])
        return shape._replace(point=center[None], axis=axis[None])
    basis = _find_across(shape.axis[0]) if shape.kind == "cylinder" else np.eye(3)

    def make(x: Float[np.ndarray, " P"]) -> Shapes:
        if shape.kind == "sphere":
            return shape._replace(point=shape.point + x[:3], radius=shape.radius + x[3])
        axis = _normalize(shape.axis + x[3:5] @ basis)
        return shape._replace(point=shape.point + x[:2] @ basis, axis=axis, radius=shape.radius + x[2])

    def compute_gaps(x: Float[np.ndarray, " P"]) -> Float[np.ndarray, " N"]:
        return np.sqrt(weights) * make(x).measure(points)[0][0]

    found = least_squares(compute_gaps, np.zeros(4 if shape.kind == "sphere" else 5), max_nfev=30)
    made = make(found.x)
    return made._replace(radius=np.abs(made.radius))


def _normalize(vectors: Float[np.ndarray, "C 3"]) -> Float[np.ndarray, "C 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _LEAST)


def _find_across(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "2 3"]:
    """Return two unit vectors that are perpendicular to an axis and to each other."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])
