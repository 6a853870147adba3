"""Measure a surface: how far from the data and the truth, and how sound as a mesh."""

from dataclasses import asdict, dataclass

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reconstruction.geometry.rows import cross_rows, find_lengths, sum_rows
from reconstruction.surfaces.intersections import find_folded_edges, find_intersections

NUM_AREA_SAMPLES = 50_000
"""Points drawn on a surface to measure its distance to another: standard error below 1 % of the mean."""


@dataclass(frozen=True)
class Distances:
    """Distances from many points to one surface, in metres.

    Attributes:
        mean: arithmetic mean.
        p95: 95th percentile.
        max: the farthest; from both sides the larger of two is the Hausdorff distance.
    """

    mean: float
    p95: float
    max: float


@dataclass(frozen=True)
class Topology:
    """What a mesh is as a combinatorial surface.

    Attributes:
        num_vertices: vertices that have a face.
        num_faces: triangles.
        unused_vertices: vertices without a face.
        boundary_edges: edges with one face.
        boundary_loops: closed chains of boundary edges; where chains touch, one piece counts once.
        non_manifold_edges: edges with more than two faces.
        pinched_vertices: vertices whose faces are not one fan.
        miswound_edges: directed edges that more than one face uses.
        components: parts that hang together by edges.
        euler_number: vertices - edges + faces.
    """

    num_vertices: int
    num_faces: int
    unused_vertices: int
    boundary_edges: int
    boundary_loops: int
    non_manifold_edges: int
    pinched_vertices: int
    miswound_edges: int
    components: int
    euler_number: int

    @property
    def is_manifold(self) -> bool:
        """Whether the mesh is a consistently wound two-manifold, with or without boundary."""
        return not (self.non_manifold_edges or self.pinched_vertices or self.miswound_edges)


@dataclass(frozen=True)
class Quality:
    """Everything measured of one mesh; distances in metres, None where there was nothing to measure against.

    Attributes:
        topology: counts.
        area: surface area [m²].
        self_intersections: pairs of faces, without a common edge, that intersect.
        folds: edges at which the surface doubles back: the normals of their faces differ by more than 120 degrees.
        folded_faces: share of faces in a fold or an intersection. Deprecated: ask for the two above.
        min_angle: mean of the faces' smallest angles [rad]; 60 degrees for equilateral triangles.
        slivers: share of faces with an angle below 10 degrees.
        cloud_to_mesh: from the data to the nearest point of the faces.
        truth_to_mesh: from points spread over the truth's area: what is missing or displaced.
        mesh_to_truth: from points spread over the mesh's area: what is displaced or invented.
        hausdorff: the larger maximum of the last two.
    """

    topology: Topology
    area: float
    self_intersections: int
    folds: int
    folded_faces: float
    min_angle: float
    slivers: float
    cloud_to_mesh: Distances | None = None
    truth_to_mesh: Distances | None = None
    mesh_to_truth: Distances | None = None
    hausdorff: float | None = None

    def as_dict(self) -> dict:
        """Return plain nested dicts, ready for JSON."""
        return asdict(self)


def measure_quality(
    mesh: trimesh.Trimesh,
    points: np.ndarray | None = None,
    truth: trimesh.Trimesh | None = None,
    *,
    num_samples: int = NUM_AREA_SAMPLES,
) -> Quality:
    """Measure a mesh, and its distances to the data and to the true surface.

    Args:
        mesh: the surface to judge.
        points: `[N, 3]` the cloud it was made from [m].
        truth: the surface it should be.
        num_samples: points spread over the area of a surface for the distances between surfaces.

    Returns:
        The same numbers for the same arguments: the samples are drawn with a fixed seed.
    """
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    areas = _find_areas(vertices, faces)
    angles = _find_angles(vertices, faces)
    intersections, folds = find_intersections(vertices, faces), find_folded_edges(vertices, faces)
    distances: dict[str, Distances | float] = {}
    if points is not None and len(points) and len(faces):
        distances["cloud_to_mesh"] = _summarize(find_distances(points, vertices, faces))
    if truth is not None and len(faces):
        true_vertices = np.asarray(truth.vertices, dtype=np.float64)
        true_faces = np.asarray(truth.faces, dtype=np.int64)
        on_truth = sample_area(true_vertices, true_faces, num_samples)
        on_mesh = sample_area(vertices, faces, num_samples)
        there = _summarize(find_distances(on_truth, vertices, faces))
        back = _summarize(find_distances(on_mesh, true_vertices, true_faces))
        distances |= {"truth_to_mesh": there, "mesh_to_truth": back, "hausdorff": max(there.max, back.max)}
    return Quality(
        topology=count_topology(faces, len(vertices)),
        area=float(areas.sum()),
        self_intersections=len(intersections),
        folds=len(folds),
        folded_faces=len(np.union1d(intersections, folds)) / max(len(faces), 1),
        min_angle=float(angles.min(axis=1).mean()) if len(faces) else 0.0,
        slivers=float((angles.min(axis=1) < np.deg2rad(10)).mean()) if len(faces) else 0.0,
        **distances,  # pyright: ignore[reportArgumentType]
    )


def find_distances(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the exact distance of every point to the nearest point of the faces: `[N]`, by libigl."""
    import igl

    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
    )
    return np.sqrt(np.maximum(squared, 0))


def sample_area(vertices: np.ndarray, faces: np.ndarray, num_samples: int, seed: int = 0) -> np.ndarray:
    """Return points spread evenly over the area of the faces: `[num_samples, 3]`, stratified by area."""
    rng = np.random.default_rng(seed)
    areas = _find_areas(vertices, faces)
    place = (np.arange(num_samples) + rng.random(num_samples)) / num_samples * areas.sum()
    face = np.minimum(np.searchsorted(np.cumsum(areas), place), len(faces) - 1)
    root, split = np.sqrt(rng.random((num_samples, 1))), rng.random((num_samples, 1))
    a, b, c = (vertices[faces[face, k]] for k in range(3))
    return (1 - root) * a + root * (1 - split) * b + root * split * c


def count_topology(faces: np.ndarray, num_vertices: int) -> Topology:
    """Count what makes, or spoils, a two-manifold.

    Args:
        faces: `[F, 3]` vertex indices.
        num_vertices: how many vertices there are, with or without faces.
    """
    faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    keys = np.sort(directed, axis=1) @ np.array([num_vertices, 1])
    edge_keys, edge_of, faces_at = np.unique(keys, return_inverse=True, return_counts=True)
    edges = np.stack(np.divmod(edge_keys, max(num_vertices, 1)), axis=1)
    _, uses = np.unique(directed @ np.array([num_vertices, 1]), return_counts=True)
    used = np.unique(faces)
    boundary = edges[faces_at == 1]
    parts = _count_parts(edges, num_vertices) - (num_vertices - len(used))
    return Topology(
        num_vertices=len(used),
        num_faces=len(faces),
        unused_vertices=num_vertices - len(used),
        boundary_edges=len(boundary),
        boundary_loops=_count_parts(boundary, num_vertices) - (num_vertices - len(np.unique(boundary))),
        non_manifold_edges=int((faces_at > 2).sum()),
        pinched_vertices=len(find_pinched(faces, edge_of, num_vertices)),
        miswound_edges=int((uses > 1).sum()),
        components=parts,
        euler_number=len(used) - len(edges) + len(faces),
    )


def find_pinched(faces: np.ndarray, edge_of: np.ndarray, num_vertices: int) -> np.ndarray:
    """Return the vertices whose faces are not one fan joined by edges.

    Args:
        faces: `[F, 3]`.
        edge_of: `[3 F]` index of the undirected edge from corner k to corner k + 1 of every face.
        num_vertices: how many vertices there are.
    """
    num_faces = len(faces)
    corner = np.arange(3 * num_faces)
    following = corner - corner % 3 + (corner + 1) % 3
    # Corners of one vertex that meet at an edge belong to one fan.
    vertex = faces.ravel()
    at_start = np.stack([vertex, edge_of], axis=1)
    at_end = np.stack([vertex[following], edge_of], axis=1)
    ends = np.concatenate([at_start, at_end])
    owners = np.concatenate([corner, following])
    wedge = ends @ np.array([edge_of.max(initial=0) + 1, 1])
    _, wedge = np.unique(wedge, return_inverse=True)
    size = 3 * num_faces + wedge.max(initial=-1) + 1
    graph = coo_array((np.ones(len(owners)), (owners, 3 * num_faces + wedge)), shape=(size, size))
    labels = connected_components(graph, directed=False)[1][: 3 * num_faces]
    fans = np.unique(np.stack([vertex, labels], axis=1), axis=0)[:, 0]
    return np.flatnonzero(np.bincount(fans, minlength=num_vertices) > 1)


def _count_parts(edges: np.ndarray, num_vertices: int) -> int:
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(num_vertices, num_vertices))
    return int(connected_components(graph, directed=False)[0])


def _find_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return find_lengths(cross_rows(b - a, c - a)) / 2


def _find_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the angle at every corner `[F, 3]` [rad]."""
    corners = vertices[faces]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.arctan2(find_lengths(cross_rows(ahead, behind)), sum_rows(ahead * behind))


def _summarize(distances: np.ndarray) -> Distances:
    return Distances(float(distances.mean()), float(np.percentile(distances, 95)), float(distances.max()))
