"""Distances between a surface and the convex pieces that stand for it, in 3-D and both ways.

Surface to contact: from points all over the surface. Inside a piece, a point lies as deep as it is behind the planes
that face where the surface looks: there contact stands in front of the surface. Outside of all pieces, it lies as far
off as the nearest piece.

Contact to surface: from points all over the pieces that a robot can touch (inside of no other piece, not behind the
surface): how far contact stands in front of the surface.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import any_rows, compute_area_vectors, compute_lengths, sum_rows
from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality, join_meshes
from symbrion_gym._src.contact.reach import Reach

Points = Float[np.ndarray, "N 3"]  # [m]
Distances = Float[np.ndarray, " N"]  # [m]
Vertices = Float[np.ndarray, "V 3"]  # [m]
Faces = Int[np.ndarray, "F 3"]

UNCOVERED_BEYOND = 0.05
"""A point of the surface farther than this from contact is uncovered [m]: half a Scout's height."""
_NUM_POINTS = 20_000  # Points on the surface, and as many on the pieces: a share of 1 % is known to 0.1 %
_INSIDE = 1e-5  # A point of a piece deeper than this in another one cannot be touched [m]
_MOST_VALUES = 4_000_000  # Distances of points from planes that are held at once: 32 MB
_LEAST_LENGTH = 1e-15  # A triangle whose edges have a shorter cross product has no normal [m²]
_PLANE_DIGITS = 9  # Planes that agree in all of these digits are one: the triangles of a flat side share it
_FACING = 0.2
"""Planes whose normal turns from a direction by more than 90 degrees, with this sine, look away from it."""


class Gaps(NamedTuple):
    """Distances of a surface and contact from each other."""

    points: Points  # on the surface [m]
    gaps: Distances  # of each from contact: above 0 where contact stands in front, below where behind [m]
    protrusions: Float[np.ndarray, " M"]  # of touchable points of contact: how far in front they stand [m]

    def find_worst(self) -> tuple[Float[np.ndarray, " 3"], float]:
        """Return the place of the largest distance, and that distance [m]."""
        worst = int(np.argmax(np.abs(self.gaps)))
        return self.points[worst], float(abs(self.gaps[worst]))


class SurfaceDistance:
    """Distance of one contact geometry after another from samples of one surface."""

    def __init__(self, surface: trimesh.Trimesh, zone: Reach | None = None) -> None:
        """Sample the surface; where there is a zone, distances are those of what lies within it."""
        self._zone = zone
        self._vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
        self._normals = _compute_normals(self._vertices, self._faces)
        self.points = self._sample(self._vertices, self._faces)
        self._directions = self._normals[find_nearest(self.points, self._vertices, self._faces)[1]]

    def _sample(self, vertices: Vertices, faces: Faces) -> Points:
        points = sample_area(vertices, faces, _NUM_POINTS)
        return points if self._zone is None else points[self._zone.measure_excess(points) <= 0]

    def compute_gaps(self, contact: Sequence[trimesh.Trimesh] | HeightField) -> Gaps:
        """Return the distances from contact; -inf where there is none."""
        if isinstance(contact, HeightField):
            return self._compute_gaps_of_sheet(contact.as_mesh())
        if not contact:
            return Gaps(self.points, np.full(len(self.points), -np.inf), np.zeros(0))
        raised = _find_depths(self.points, contact, self._directions)
        vertices, faces = join_meshes(contact)
        distance, _, _ = find_nearest(self.points, vertices, faces)
        points = self._sample(vertices, faces)
        heights, distances = self._measure_heights(points[compute_depths(points, contact) <= _INSIDE])
        is_touchable = heights > -UNCOVERED_BEYOND
        protrusions = np.where(heights > 0, distances, 0.0)[is_touchable]
        return Gaps(self.points, np.where(raised > 0, raised, -distance), protrusions)

    def _compute_gaps_of_sheet(self, sheet: trimesh.Trimesh) -> Gaps:
        """Return the distances from an open sheet with everything beneath it solid: a height field."""
        vertices, faces = np.asarray(sheet.vertices), np.asarray(sheet.faces)
        distance, face, nearest = find_nearest(self.points, vertices, faces)
        height = np.einsum("ni,ni->n", self.points - nearest, _compute_normals(vertices, faces)[face])
        heights, distances = self._measure_heights(self._sample(vertices, faces))
        return Gaps(
            self.points, np.where(height < 0, distance, -distance), np.where(heights > 0, distances, 0.0)
        )

    def _measure_heights(self, points: Points) -> tuple[Distances, Distances]:
        """Return how far points lie in front of the nearest face's plane, and their distances from it [m]."""
        distance, face, nearest = find_nearest(points, self._vertices, self._faces)
        return np.einsum("ni,ni->n", points - nearest, self._normals[face]), distance

    def measure(self, contact: Sequence[trimesh.Trimesh] | HeightField, seconds: float = 0.0) -> ArenaQuality:
        """Return the distances from contact as figures."""
        gaps = self.compute_gaps(contact)
        uncovered = float((np.abs(gaps.gaps) > UNCOVERED_BEYOND).mean())
        count = 0 if isinstance(contact, HeightField) else len(contact)
        return ArenaQuality.of_gaps(gaps.gaps, uncovered, count, seconds, gaps.protrusions)

    def measure_mesh(self, mesh: trimesh.Trimesh) -> Distances:
        """Return the distances of the samples from another mesh [m]."""
        return find_nearest(self.points, np.asarray(mesh.vertices), np.asarray(mesh.faces))[0]


def find_nearest(
    points: Points, vertices: Vertices, faces: Faces
) -> tuple[Distances, Int[np.ndarray, " N"], Points]:
    """Return the distance [m], face and place of the nearest point of the faces, by libigl.

    Without any face the distance is infinite, face and place are -1 and NaN.
    """
    import igl

    if not len(points) or not len(faces):  # of which libigl reads beyond its arrays
        count = len(points)
        return np.full(count, np.inf), np.full(count, -1), np.full((count, 3), np.nan)
    squared, face, place = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
    )
    return np.sqrt(np.maximum(squared, 0.0)), np.asarray(face, dtype=np.int64), np.asarray(place)


def _compute_normals(vertices: Vertices, faces: Faces) -> Float[np.ndarray, "F 3"]:
    normals = compute_area_vectors(vertices, faces)
    return normals / np.maximum(compute_lengths(normals), np.finfo(float).tiny)[:, None]


def compute_depths(points: Points, pieces: Sequence[trimesh.Trimesh]) -> Distances:
    """Return how deep points are inside convex pieces [m]: the distance of the nearest plane, of the deepest piece."""
    return _find_depths(points, pieces, None)


def _find_depths(points: Points, pieces: Sequence[trimesh.Trimesh], directions: Points | None) -> Distances:
    """Return how deep points are [m]: the distance of the nearest plane that does not look away from a direction."""
    found = np.zeros(len(points))
    for members, below, normals in _find_inside(points, pieces):
        depths = below.min(axis=1)
        if directions is not None:
            behind = np.where(directions[members] @ normals.T < -_FACING, np.inf, below).min(axis=1)
            depths = np.where(np.isfinite(behind), behind, depths)
        found[members] = np.maximum(found[members], depths)
    return found


def _find_inside(
    points: Points, pieces: Sequence[trimesh.Trimesh]
) -> Iterator[tuple[Int[np.ndarray, " M"], Float[np.ndarray, "M P"], Float[np.ndarray, "P 3"]]]:
    """Give the points in each solid, their depths below its planes [m], and the planes' normals."""
    by_extent = np.argsort(-np.ptp(points, axis=0)) if len(points) else np.arange(3)
    order = np.argsort(points[:, by_extent[0]], kind="stable")
    ordered = np.ascontiguousarray(points[order].T)
    for piece in pieces:
        low, high = piece.bounds
        first, last = np.searchsorted(ordered[by_extent[0]], (low[by_extent[0]], high[by_extent[0]]))
        near = np.arange(first, last)
        for axis in by_extent[1:]:
            along = ordered[axis, near]
            near = near[(along > low[axis]) & (along < high[axis])]
        if not len(near):
            continue
        planes = find_planes(piece)
        for part in np.array_split(near, len(near) * len(planes) // _MOST_VALUES + 1):
            below = planes[:, 3] - ordered[:, part].T @ planes[:, :3].T
            is_inside = (below > 0).all(axis=1)
            if is_inside.any():
                yield order[part[is_inside]], below[is_inside], planes[:, :3]


def find_planes(piece: trimesh.Trimesh) -> Float[np.ndarray, "P 4"]:
    """Return the planes of a convex solid as outward unit normal and offset: inside, normal · x < offset."""
    vertices, faces = np.asarray(piece.vertices), np.asarray(piece.faces)
    normals = compute_area_vectors(vertices, faces)
    length = compute_lengths(normals)
    is_face = length > _LEAST_LENGTH
    normals = normals[is_face] / length[is_face, None]
    offsets = sum_rows(normals * vertices[faces[is_face, 0]])[:, None]
    outward = np.where(normals @ vertices.mean(axis=0)[:, None] > offsets, -1.0, 1.0)
    planes = np.round(outward * np.concatenate([normals, offsets], axis=1), _PLANE_DIGITS)
    planes = planes[np.lexsort(planes.T)]
    is_new = np.ones(len(planes), dtype=bool)
    is_new[1:] = any_rows(planes[1:] != planes[:-1])
    return planes[is_new]


class NearestPoints(NamedTuple):
    """Nearest points of a surface."""

    heights: Distances  # how far they are, below 0 behind the surface: where its faces do not look to [m]
    normals: Points  # unit normals of the nearest faces


def find_signed_nearest(points: Points, surface: trimesh.Trimesh) -> NearestPoints:
    """Return how far points are from a surface, on which side, and how the surface faces there."""
    import igl

    vertices, index = np.unique(np.asarray(surface.vertices, dtype=np.float64), axis=0, return_inverse=True)
    faces = index.ravel()[np.asarray(surface.faces)]
    normals = _compute_normals(vertices, faces)
    is_face = normals.any(axis=1)
    heights, face, _, _ = igl.signed_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        vertices,
        np.ascontiguousarray(faces[is_face]),
        igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )
    return NearestPoints(np.ravel(heights), normals[is_face][np.ravel(face)])


_FINEST = 1.0 / 35.0  # Contact need not be closer, in sizes of the robot: a Scout's tracks do not feel 3 mm
_EXTENT = 1.0 / 500.0  # ... or this share of the extent of the surface, for small things.
_COARSEST = 1.0 / 10.0  # Contact must not be farther off, in sizes of the robot, however sparse readings are
_SPACING = 0.1  # In median distances of neighboring readings over the surface
_MESH = 0.05  # Without readings, in median lengths of the edges of the surface
_DRAWN = 2.0  # ... but no more than this many times the finest: a drawn mesh with long edges is exact.
_NUM_READINGS = 5000  # Readings that are looked at
_DEVIATION = 1.4826  # Standard deviation of a normal distribution over the median of its absolute values


def find_accuracy(surface: trimesh.Trimesh, size: float, points: Points | None = None) -> float:
    """Return the accuracy that contact geometry of a scanned surface should have for a robot of some size [m].

    The median distance of readings from the surface gives their noise; spacing is that of the surface's area, so
    that dense readings near the scanner do not stand for those far from it.
    """
    finest = min(_FINEST * size, _EXTENT * float(surface.extents.max()))
    if points is None or len(points) < 2:
        edges = _MESH * float(np.median(surface.edges_unique_length))
        return min(max(finest, edges), _DRAWN * finest)
    chosen = np.sort(np.random.default_rng(0).permutation(len(points))[:_NUM_READINGS])
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    noise = _DEVIATION * float(np.median(find_nearest(points[chosen], vertices, faces)[0]))
    tree = cKDTree(points)
    _, nearest = tree.query(sample_area(vertices, faces, _NUM_READINGS))
    distance, _ = tree.query(points[nearest], k=2)
    wanted = max(noise, _SPACING * float(np.median(distance[:, 1])))
    return min(max(finest, wanted), _COARSEST * size)
