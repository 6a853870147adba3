"""A known object, prepared for the search: samples with normals, a light mesh, symmetries."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.manifold import compute_normals
from reconstruction._src.geometry.mesh_repair import simplify
from reconstruction._src.geometry.pose import rotate_about
from reconstruction._src.geometry.rows import Faces, Points, Vertices, compute_areas, compute_lengths
from reconstruction._src.geometry.sampling import sample_area

if TYPE_CHECKING:
    import trimesh

_MAX_FACES = 400  # Rays are cast at a mesh of no more faces than this
_NUM_SAMPLES = 1200
_MIN_SIZE, _MAX_SIZE = 0.02, 5.0  # [m]
_SAME = 0.01  # Two shapes are the same where no sample is farther off than this share of the diameter
_SAME_AXIS = np.cos(np.deg2rad(3.0))  # Axes of inertia that deviate less from x, y or z are taken as these
_FOLDS = (2, 3, 4, 6)
_ROUND_STEPS = 36  # A body of revolution is taken as one with this many equal positions
_EQUAL_ROTATIONS = 0.02  # Rotations whose matrices differ by less are one


class ObjectModel(NamedTuple):
    """A known object, in the frame of its mesh."""

    name: str  # what it is called
    vertices: Vertices  # of a light mesh for rays and distances [m]
    faces: Faces  # wound with the normals outwards
    normals: Float[np.ndarray, "F 3"]  # of the faces
    tree: Any  # igl.AABB of the faces
    points: Float[np.ndarray, "P 3"]  # samples [m]
    point_normals: Float[np.ndarray, "P 3"]  # normals at the samples
    samples: cKDTree  # of the samples
    center: Float[np.ndarray, " 3"]  # middle of its area [m]
    radius: float  # distance of the farthest vertex from it [m]
    spread: Float[np.ndarray, " 3"]  # deviations of the samples along the principal axes, ascending [m]
    largest_side: float  # area of the largest side of the bounding box [m²]
    turns: Float[np.ndarray, "T 3 3"]  # rotations about the center to poses it could be mistaken in
    symmetries: Float[np.ndarray, "S 3 3"]  # rotations about the center under which it looks the same

    def measure_distances(self, points: Points) -> Float[np.ndarray, " N"]:
        """Return the distances of points from the object [m]."""
        if not len(points):
            return np.zeros(0)
        found = self.tree.squared_distance(self.vertices, self.faces, np.ascontiguousarray(points))
        return np.sqrt(np.maximum(found[0], 0.0))

    def place(self, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " 3"]:
        """Return where the center is at a pose [m]."""
        return pose[:3, :3] @ self.center + pose[:3, 3]


def make_model(name: str, mesh: "trimesh.Trimesh") -> ObjectModel:
    """Prepare an object."""
    import igl

    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise ReconstructionError(f"object {name!r}: the mesh has no faces, or vertices that are not finite")
    sides = np.sort(np.ptp(np.asarray(mesh.bounds, dtype=np.float64), axis=0))
    if not _MIN_SIZE <= sides[2] <= _MAX_SIZE:
        raise ReconstructionError(
            f"object {name!r} is {sides[2]:.4g} m long; objects of {_MIN_SIZE:g} to {_MAX_SIZE:g} m can be found "
            "(is the mesh in meters?)"
        )
    all_faces = np.asarray(mesh.faces, np.int64)
    vertices, faces = simplify(
        np.asarray(mesh.vertices, np.float64), all_faces, min(_MAX_FACES, len(all_faces))
    )
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    tree = igl.AABB()
    tree.init(vertices, faces)
    normals = compute_normals(vertices, faces)
    points = sample_area(vertices, faces, _NUM_SAMPLES, 0)
    center = np.average(vertices[faces].mean(axis=1), axis=0, weights=compute_areas(vertices, faces))
    spread, axes = compute_spread(points)
    nearest = np.asarray(tree.squared_distance(vertices, faces, points)[1])
    return ObjectModel(
        name,
        vertices,
        faces,
        normals,
        tree,
        points,
        normals[nearest],
        cKDTree(points),
        center,
        radius=float(compute_lengths(vertices - center).max()),
        spread=spread,
        largest_side=float(sides[1] * sides[2]),
        turns=_list_turns(axes),
        symmetries=compute_symmetries(mesh, center),
    )


def compute_spread(points: Points) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "3 3"]]:
    """Return the deviations along the principal axes, ascending [m], and the axes as columns of a rotation."""
    offset = points - points.mean(axis=0)
    variances, axes = np.linalg.eigh(offset.T @ offset / len(points))
    return np.sqrt(np.maximum(variances, 0.0)), axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]


def compute_symmetries(
    mesh: "trimesh.Trimesh", center: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "S 3 3"]:
    """Return the rotations about a center that map a mesh onto itself, the identity first.

    Tried are full fractions of a turn about the axes x, y, z and the axes of inertia; combinations of those found
    belong to the result as well.
    """
    import igl

    vertices, faces = np.ascontiguousarray(mesh.vertices - center), np.ascontiguousarray(mesh.faces, np.int64)
    points = sample_area(vertices, faces, _NUM_SAMPLES, 0)
    limit = _SAME * 2 * float(compute_lengths(points).max())

    def select_same(rotations: np.ndarray) -> list[np.ndarray]:
        turned = np.ascontiguousarray(points @ rotations.swapaxes(1, 2)).reshape(-1, 3)
        squared = np.asarray(igl.point_mesh_squared_distance(turned, vertices, faces)[0])
        return list(rotations[squared.reshape(len(rotations), -1).max(axis=1) <= limit**2])

    found = [np.eye(3)]
    own = [axis for axis in np.linalg.eigh(points.T @ points)[1].T if np.abs(axis).max() < _SAME_AXIS]
    for axis in [*np.eye(3), *own]:
        if select_same(rotate_about(axis, np.array([2.0]))):  # no symmetry but that of revolution
            across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
            flip = rotate_about(across / np.linalg.norm(across), np.array([np.pi]))
            step = rotate_about(axis, np.array([2 * np.pi / _ROUND_STEPS]))
            return _close_group([np.eye(3), *step, *select_same(flip)])
        found += select_same(rotate_about(axis, 2 * np.pi / np.array(_FOLDS)))
    return _close_group(found)


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
    return turned[int(np.argmax(np.round(np.trace(turned, axis1=1, axis2=2), 6)))]


def _list_turns(axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "T 3 3"]:
    """Return rotations by odd multiples of 45 degrees about each of three axes, and the 24 of a cube in them."""
    cube = axes @ Rotation.create_group("O").as_matrix() @ axes.T
    single = [turn for axis in axes.T for turn in rotate_about(axis, np.pi / 4 * np.array([1, 3, 5, 7]))]
    return np.concatenate([cube, single])


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
        if not any(np.abs(each - other).max() < _EQUAL_ROTATIONS for other in kept):
            kept.append(each)
    return kept
