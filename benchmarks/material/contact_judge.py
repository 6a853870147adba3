"""An independent judge of contact geometry: it shares no code with what makes arenas or measures their quality.

Distances are exact (libigl), rays are cast by Embree, the union of the pieces is that of manifold3d, and whether a
point is solid is told by the half-spaces of each piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, cKDTree

from benchmarks.material.scan_sources import ScanCase

NEAR = 0.05
"""Contact farther from the surface than this is absent, a beam farther from its reading misses it [m]."""
NUM_SAMPLES = 60_000
"""Samples of a surface."""
NUM_BEAMS = 20_000
"""Beams that are compared."""
NUM_CELLS = 120
"""Free space is sampled once in each cell; so many cells stand along the longest side."""
_SEEN = 0.03
"""Truth farther from every reading than this, or twice the spacing of the readings there, was not seen [m]."""


@dataclass(frozen=True)
class Solid:
    """Contact geometry.

    Attributes:
        boundary: outer boundary of all pieces together; the ground itself for a height field.
        pieces: convex pieces; none for a height field.
        casts: what rays hit.
    """

    boundary: trimesh.Trimesh
    pieces: list[trimesh.Trimesh]
    casts: trimesh.Trimesh

    @classmethod
    def of_pieces(cls, pieces: list[trimesh.Trimesh]) -> Solid:
        """Unite convex pieces; MuJoCo takes the hull of each, so that is what counts."""
        hulls = [hull for piece in pieces if (hull := _find_hull(np.asarray(piece.vertices))) is not None]
        casts = trimesh.util.concatenate(hulls)
        assert isinstance(casts, trimesh.Trimesh)
        return cls(_unite(hulls), hulls, casts)

    @classmethod
    def of_ground(cls, ground: trimesh.Trimesh) -> Solid:
        """Take a height field, solid below."""
        return cls(ground, [], ground)

    def is_inside(self, points: np.ndarray) -> np.ndarray:
        """Return whether each point is solid, `[N]`."""
        if not self.pieces:
            height = _find_height_above(self.boundary, points)
            return np.where(np.isfinite(height), height < 0, False)
        tree, is_inside = cKDTree(points), np.zeros(len(points), bool)
        for piece in self.pieces:
            low, high = piece.bounds
            near = np.array(tree.query_ball_point((low + high) / 2, np.linalg.norm(high - low) / 2), int)
            near = near[~is_inside[near]]
            if len(near):
                normals, starts = piece.face_normals, piece.triangles[:, 0]
                outside = points[near] @ normals.T - np.einsum("fi,fi->f", normals, starts)
                is_inside[near] = outside.max(axis=1) < 0
        return is_inside


def compute_distances(points: np.ndarray, mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the distance of every point from a mesh, `[N]` [m]."""
    import igl

    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    squares = igl.point_mesh_squared_distance(np.ascontiguousarray(points, float), vertices, faces)[0]
    return np.sqrt(np.asarray(squares))


def cast(mesh: trimesh.Trimesh, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return how far each ray goes, `[R]` [m]; inf where it hits nothing."""
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    faces = np.asarray(RayMeshIntersector(mesh).intersects_first(origins, directions))
    starts, normals = np.asarray(mesh.triangles)[faces, 0], np.asarray(mesh.face_normals)[faces]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = np.einsum("ij,ij->i", starts - origins, normals) / np.einsum("ij,ij->i", directions, normals)
    return np.where((faces >= 0) & np.isfinite(ranges), ranges, np.inf)


def sample(mesh: trimesh.Trimesh, count: int, seed: int = 0) -> np.ndarray:
    """Return points spread evenly over a mesh, `[count, 3]`."""
    return np.asarray(trimesh.sample.sample_surface(mesh, count, seed=seed)[0])


class Judge:
    """Measures surfaces and contact of one cloud, always on the same samples.

    Attributes:
        case: the cloud.
    """

    def __init__(self, case: ScanCase) -> None:
        self.case = case

    def judge_surface(self, surface: trimesh.Trimesh) -> dict[str, float]:
        """Return the error of a surface against all readings and the truth [m], and the shares of beams."""
        found = _summarise("points", compute_distances(self.case.points, surface))
        if self.case.truth is not None:
            found |= _summarise("truth", compute_distances(self.seen_truth, surface))
        return found | (self._judge_beams(surface) if self.case.origins is not None else {})

    def judge_contact(self, surface: trimesh.Trimesh, solid: Solid) -> dict[str, float]:
        """Return errors of contact against the surface, all readings and the truth [m]; shares from 0 to 1."""
        distances = compute_distances(sample(surface, NUM_SAMPLES), solid.boundary)
        found = _summarise("contact", distances)
        found["uncovered"] = float(np.mean(distances > NEAR))
        readings = _choose(self.case.points, NUM_SAMPLES)
        found |= _summarise("contact_points", compute_distances(readings, solid.boundary))
        if self.case.truth is not None:
            found |= _summarise("contact_truth", compute_distances(self.seen_truth, solid.boundary))
        if self.case.origins is not None:
            found |= self._judge_beams(solid.casts, solid)
            found["free_space"] = float(solid.is_inside(self.free_space).mean())
        return found

    def count_unseen(self, surface: trimesh.Trimesh, places: np.ndarray) -> int:
        """Return how many places on the ground nothing saw: 5 cm above each, seen from where its nearest reading was.

        The upper side of a ceiling that was scanned from below is such a place.
        """
        assert self.case.origins is not None
        nearest = cKDTree(self.case.points).query(places)[1]
        origins, targets = self.case.origins[nearest], places + np.array([0.0, 0.0, NEAR])
        lengths = np.linalg.norm(targets - origins, axis=1)
        ranges = cast(surface, origins, (targets - origins) / lengths[:, None])
        return int((ranges < lengths - NEAR).sum())

    @cached_property
    def seen_truth(self) -> np.ndarray:
        """Samples of the true body where it was scanned, `[M, 3]`."""
        assert self.case.truth is not None
        points, tree = sample(self.case.truth, 2 * NUM_SAMPLES), cKDTree(self.case.points)
        distance, nearest = tree.query(points)
        return points[distance < np.maximum(_SEEN, 2 * self._compute_spacing(tree, nearest))]

    @cached_property
    def free_space(self) -> np.ndarray:
        """Points that beams passed, about evenly in space and 5 cm or more from every reading, `[M, 3]`."""
        origins, ends, lengths = self._choose_beams(2 * NUM_BEAMS)
        extent = np.ptp(self.case.points, axis=0)
        # A vertical beam from the air is free for its whole height; what matters is near the ground.
        is_told = self.case.viewpoints is not None
        begin = np.zeros(len(lengths)) if is_told else np.maximum(lengths - extent[2] - 1.0, 0.0)
        share = np.random.default_rng(0).random((20, len(lengths))) ** (1 / 3)
        along = begin + (lengths - NEAR - begin) * share
        points = (origins + (ends - origins) * (along / lengths)[..., None])[along > 0]
        cells = np.floor(points / (extent.max() / NUM_CELLS)).astype(np.int64)
        points = _choose(points[np.unique(cells, axis=0, return_index=True)[1]], NUM_SAMPLES)
        tree = cKDTree(self.case.points)
        distance, nearest = tree.query(points)
        # Between sparse readings a beam that grazes the ground is within its noise: the gap there counts as well.
        return points[distance > np.maximum(NEAR, self._compute_spacing(tree, nearest))]

    def _judge_beams(self, mesh: trimesh.Trimesh, solid: Solid | None = None) -> dict[str, float]:
        """Return the share of beams that end within 5 cm of their reading, before it, and beyond.

        A beam that begins in the solid ends there.
        """
        origins, ends, lengths = self._choose_beams(NUM_BEAMS)
        ranges = cast(mesh, origins, (ends - origins) / lengths[:, None])
        if solid is not None:
            ranges[solid.is_inside(origins)] = 0.0
        off = ranges - lengths
        return {
            "beams": float(np.mean(np.abs(off) <= NEAR)),
            "beams_before": float(np.mean(off < -NEAR)),
            "beams_beyond": float(np.mean(off > NEAR)),
        }

    def _choose_beams(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return where beams begin and end, `[R, 3]` [m], and how long they are."""
        assert self.case.origins is not None
        rows = _choose(np.arange(len(self.case.points)), count)
        origins, ends = np.ascontiguousarray(self.case.origins[rows]), self.case.points[rows]
        lengths = np.linalg.norm(ends - origins, axis=1)
        is_long = lengths > NEAR
        return origins[is_long], ends[is_long], lengths[is_long]

    def _compute_spacing(self, tree: cKDTree, rows: np.ndarray) -> np.ndarray:
        """Return the distance of readings to their third neighbors [m]."""
        return tree.query(self.case.points[rows], k=4)[0][:, -1]


def _find_hull(points: np.ndarray) -> trimesh.Trimesh | None:
    """Return the convex hull, wound outwards; None if the points are flat."""
    try:
        hull = ConvexHull(points - points.mean(axis=0))
    except Exception:  # Qhull refuses what is flat in more than one way
        return None
    mesh = trimesh.Trimesh(points, hull.simplices, process=False)
    inward = np.einsum("fi,fi->f", mesh.face_normals, hull.equations[:, :3]) < 0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    used, flat = np.unique(faces, return_inverse=True)
    return trimesh.Trimesh(points[used], flat.reshape(-1, 3), process=False)


def _unite(hulls: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    import manifold3d

    parts = [
        manifold3d.Manifold.hull_points(np.ascontiguousarray(hull.vertices, np.float32).astype(np.float64))
        for hull in hulls
    ]
    whole = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(whole.vert_properties[:, :3], whole.tri_verts, process=False)


def _find_height_above(ground: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    top = ground.bounds[1, 2] + 1.0
    starts = np.column_stack([points[:, :2], np.full(len(points), top)])
    ranges = cast(ground, starts, np.broadcast_to([0.0, 0.0, -1.0], points.shape).copy())
    return points[:, 2] - (top - ranges)


def _choose(rows: np.ndarray, count: int) -> np.ndarray:
    """Return at most this many rows, at random but always the same."""
    if len(rows) <= count:
        return rows
    return rows[np.sort(np.random.default_rng(0).permutation(len(rows))[:count])]


def _summarise(name: str, distances: np.ndarray) -> dict[str, float]:
    return {
        f"{name}_mean": float(distances.mean()),
        f"{name}_p95": float(np.percentile(distances, 95)),
        f"{name}_max": float(distances.max()),
    }
