"""A known object, prepared for the search: samples with normals, a light mesh for rays, symmetries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.range_checks import check_positive
from reconstruction._src.geometry.mesh_repair import simplify
from reconstruction._src.geometry.rows import compute_areas, compute_lengths, cross_rows
from reconstruction._src.geometry.sampling import sample_area

if TYPE_CHECKING:
    import trimesh


SPACING = 0.008
"""Readings are averaged in cells of this width for the search [m]. Wider: faster, and small parts of an
object are lost. The verification uses every beam."""
MIN_NOISE = 0.002  # Noise that is measured counts as no less [m]: the mesh of an object is not exact either
MIN_COVERAGE = 0.3
"""Share of the beams at the object that end on it; lower: objects that are hidden for a larger part are
found, and more that are none."""
MIN_BEAMS = 40  # Fewest beams that must end on an object
PLANE_AREA = 2.5
"""A plane of this many times the largest side of the object's box is wall, floor or table top. It is not
searched."""
NUM_HYPOTHESES = 12  # As many poses of the library are refined in each region
SAMPLING = 0.07  # Distance of the points of the object in the library's matching, as a share of its diameter


@dataclass(frozen=True)
class ObjectsConfig:
    """How known objects are searched for, and what counts as found.

    Attributes:
        noise: standard deviation of the ranges [m]; None to measure it on the large planes of the scan.
        tolerance: a beam agrees with the object within this many standard deviations of the noise.
        min_score: share of the beams that agree, of those that say something; lower: more false finds.

    Raises:
    """

    noise: float | None = None
    tolerance: float = 3.0
    min_score: float = 0.94

    def __post_init__(self) -> None:
        names = ["tolerance", "min_score", *(["noise"] if self.noise is not None else [])]
        check_positive(self, names, ReconstructionError)
        if self.min_score > 1.0:
            raise ReconstructionError(
                f"ObjectsConfig.min_score is a share, at most 1, got {self.min_score!r}"
            )


SAME = 0.01
"""Two shapes are the same where no sample is farther from the other than this share of the diameter."""
_SAME_AXIS = np.cos(np.deg2rad(3.0))
"""Axes of inertia that deviate less from x, y or z than 3 degrees are taken as these."""
_NUM_SAMPLES = 1500
_FOLDS = (2, 3, 4, 6)
_ROUND_STEPS = 36  # A body of revolution is taken as one with this many equal positions


def compute_symmetries(mesh: trimesh.Trimesh, center: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "S 3 3"]:
    """Return the rotations about a center that map a mesh onto itself, the identity first.

    Tried are rotations by full fractions of a turn about the axes x, y, z and the axes of inertia;
    combinations of those found belong to the result as well.
    """
    points = sample_area(np.asarray(mesh.vertices), np.asarray(mesh.faces), _NUM_SAMPLES, 0) - center
    _, axes = np.linalg.eigh(points.T @ points)
    limit = SAME * 2 * float(np.linalg.norm(points, axis=1).max())
    found = [np.eye(3)]
    own = [axis for axis in axes.T if np.abs(axis).max() < _SAME_AXIS]
    for axis in [*np.eye(3), *own]:
        if is_same(mesh, center, points, make_turn(axis, 2.0), limit):  # no symmetry but that of revolution
            found = [make_turn(axis, 2 * np.pi * k / _ROUND_STEPS) for k in range(_ROUND_STEPS)]
            flip = make_turn(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]), np.pi)
            return _close_group([*found[:2], *([flip] if is_same(mesh, center, points, flip, limit) else [])])
        for fold in _FOLDS:
            turn = make_turn(axis, 2 * np.pi / fold)
            if is_same(mesh, center, points, turn, limit):
                found.append(turn)
    return _close_group(found)


def is_same(
    mesh: trimesh.Trimesh,
    center: Float[np.ndarray, " 3"],
    points: Float[np.ndarray, "N 3"],
    rotation: Float[np.ndarray, "3 3"],
    limit: float,
) -> bool:
    """Return whether samples about the center, rotated, all lie on the mesh within a limit [m]."""
    import igl

    vertices = np.ascontiguousarray(np.asarray(mesh.vertices) - center)
    faces = np.ascontiguousarray(mesh.faces, np.int64)
    found = igl.point_mesh_squared_distance(np.ascontiguousarray(points @ rotation.T), vertices, faces)
    return bool(np.sqrt(np.asarray(found[0]).max()) <= limit)


def make_turn(axis: Float[np.ndarray, " 3"], angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the rotation about an axis by an angle [rad] (Rodrigues)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis)).as_matrix()


def compute_angle(
    first: Float[np.ndarray, "3 3"],
    second: Float[np.ndarray, "3 3"],
    symmetries: Float[np.ndarray, "S 3 3"] | None = None,
) -> float:
    """Return the smallest angle between two rotations of an object [rad], its symmetries left out of account."""
    turned = first[None] if symmetries is None else first @ symmetries
    trace = np.einsum("sij,ij->s", turned, second)
    return float(np.arccos(np.clip((trace.max() - 1) / 2, -1.0, 1.0)))


def choose_equivalent(
    rotation: Float[np.ndarray, "3 3"], symmetries: Float[np.ndarray, "S 3 3"]
) -> Float[np.ndarray, "3 3"]:
    """Return of the rotations that look the same the one that turns least."""
    turned = rotation @ symmetries
    trace = np.trace(turned, axis1=1, axis2=2)
    return turned[int(np.argmax(np.round(trace, 6)))]


def list_turns(axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "T 3 3"]:
    """Return rotations by multiples of 45 degrees about each of three axes (columns), and the 24 of a cube in them."""
    from scipy.spatial.transform import Rotation

    cube = [axes @ turn @ axes.T for turn in Rotation.create_group("O").as_matrix()]
    single = [make_turn(axis, k * np.pi / 4) for axis in axes.T for k in (1, 3, 5, 7)]
    return np.array(_unique([*cube, *single]))


def _close_group(rotations: list[np.ndarray]) -> Float[np.ndarray, "S 3 3"]:
    """Return the products of rotations, each once; a sphere, which has no end of them, keeps those of two axes."""
    group = _unique(rotations)
    while True:
        larger = _unique([*group, *(a @ b for a in group for b in rotations[1:7])])
        if len(larger) == len(group) or len(larger) > 4 * _ROUND_STEPS:
            return np.array(larger)
        group = larger


def _unique(rotations: list[np.ndarray]) -> list[np.ndarray]:
    kept: list[np.ndarray] = []
    for each in rotations:
        if not any(np.abs(each - other).max() < 0.02 for other in kept):
            kept.append(each)
    return kept


_NUM_STEPS = 36  # Fields along the longest side of the table: an eighteenth of the radius each, nearly
REACH = 0.5  # The table reaches as far beyond the object, as a share of its radius


class NearestFaces(NamedTuple):
    """The nearest face of each field of a grid."""

    low: Float[np.ndarray, " 3"]  # corner of the grid [m]
    step: float  # width of a field [m]
    face: Int[np.ndarray, "A B C"]  # index of the face that is nearest to the middle of a field
    distance: Float[np.ndarray, "A B C"]  # from the middle to it [m]

    def find(
        self, points: Float[np.ndarray, "K M 3"]
    ) -> tuple[Float[np.ndarray, "K M"], Int[np.ndarray, "K M"]]:
        """Return about the distance [m] and the nearest face of each point; infinite off the table."""
        field = np.floor((points - self.low) / self.step).astype(np.int64)
        inside = ((field >= 0) & (field < self.face.shape)).all(axis=-1)
        i, j, k = np.where(np.asarray(inside)[..., None], field, 0).reshape(-1, 3).T
        distance = np.where(inside, self.distance[i, j, k].reshape(inside.shape), np.inf)
        return distance, self.face[i, j, k].reshape(inside.shape)


def make_nearest_faces(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], radius: float
) -> NearestFaces:
    """Make the table of an object [m]."""
    import igl

    low = vertices.min(axis=0) - REACH * radius
    extent = vertices.max(axis=0) + REACH * radius - low
    step = float(extent.max()) / _NUM_STEPS
    shape = tuple(np.ceil(extent / step).astype(int))
    fields = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    middles = np.ascontiguousarray(low + (fields + 0.5) * step)
    squared, face = igl.point_mesh_squared_distance(middles, vertices, faces)[:2]
    return NearestFaces(
        low, step, np.asarray(face, np.int64).reshape(shape), np.sqrt(np.asarray(squared)).reshape(shape)
    )


MAX_FACES = 400  # Rays are cast at a mesh of no more faces than this
NUM_SAMPLES = 1200
_MIN_SIZE, _MAX_SIZE = 0.02, 5.0


class ObjectModel(NamedTuple):
    """A known object."""

    name: str  # what it is called
    vertices: Float[np.ndarray, "V 3"]  # of the mesh for rays and distances, in the object's frame [m]
    faces: Int[np.ndarray, "F 3"]  # wound with the normals outwards
    normals: Float[np.ndarray, "F 3"]  # of the faces
    points: Float[np.ndarray, "P 3"]  # samples [m]
    point_normals: Float[np.ndarray, "P 3"]  # normals at the samples
    center: Float[np.ndarray, " 3"]  # middle of its area [m]
    radius: float  # distance of the farthest vertex from it [m]
    nearest: NearestFaces  # the face nearest to each place about the object
    # standard deviations of the samples along the principal axes, the smallest first [m]
    spread: Float[np.ndarray, " 3"]
    largest_side: float  # area of the largest side of the bounding box [m²]
    # rotations about the center that lead to poses the object could be mistaken in
    turns: Float[np.ndarray, "T 3 3"]
    symmetries: Float[np.ndarray, "S 3 3"]  # rotations about the center under which the object looks the same


def make_model(name: str, mesh: trimesh.Trimesh) -> ObjectModel:
    """Prepare an object."""
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise ReconstructionError(f"object {name!r}: the mesh has no faces, or vertices that are not finite")
    low, high = np.asarray(mesh.bounds, dtype=np.float64)
    size = float((high - low).max())
    if not _MIN_SIZE <= size <= _MAX_SIZE:
        raise ReconstructionError(
            f"object {name!r} is {size:.4g} m long; objects of {_MIN_SIZE:g} to {_MAX_SIZE:g} m can be found "
            "(is the mesh in meters?)"
        )
    full_vertices, full_faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    vertices, faces = simplify(full_vertices, full_faces, min(MAX_FACES, len(full_faces)))
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    normals = _compute_normals(vertices, faces)
    points = sample_area(vertices, faces, NUM_SAMPLES, 0)
    center = np.average(vertices[faces].mean(axis=1), axis=0, weights=compute_areas(vertices, faces))
    sides = np.sort(high - low)
    radius = float(compute_lengths(vertices - center).max())
    return ObjectModel(
        name,
        vertices,
        faces,
        normals,
        points,
        normals[_find_nearest_faces(points, vertices, faces)],
        center,
        radius,
        make_nearest_faces(vertices, faces, radius),
        compute_spread(points),
        float(sides[1] * sides[2]),
        list_turns(_compute_axes(points)),
        compute_symmetries(mesh, center),
    )


def _compute_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = vertices[faces]
    normals = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.maximum(compute_lengths(normals), 1e-300)[:, None]


def _find_nearest_faces(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    import igl

    return np.asarray(igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)[1])


def compute_spread(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " 3"]:
    """Return the standard deviations of points along their principal axes, the smallest first [m]."""
    offset = points - points.mean(axis=0)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(offset.T @ offset / len(points)), 0.0))


def _compute_axes(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the principal axes of points, as columns of a rotation."""
    offset = points - points.mean(axis=0)
    axes = np.linalg.eigh(offset.T @ offset)[1]
    return axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])
