"""Measure a surface: its distances to the data and to the truth, and its quality as a mesh."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int, Num

from reconstruction._src.geometry.manifold import group_sides, label_parts
from reconstruction._src.geometry.rows import (
    Faces,
    Vertices,
    compute_areas,
    compute_lengths,
    cross_rows,
    sum_rows,
)
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.surfaces.intersections import find_folded_edges, find_intersections

NUM_AREA_SAMPLES = 50_000
"""Points drawn on a surface to measure its distance to another: standard error below 1 % of the mean."""
SLIVER_ANGLE = np.deg2rad(10)  # A face with a smaller angle is a sliver


@dataclass(frozen=True)
class Distances:
    """Distances from many points to one surface, in meters."""

    mean: float  # arithmetic mean
    p95: float  # 95th percentile
    max: float  # the farthest; from both sides the larger of two is the Hausdorff distance


@dataclass(frozen=True)
class Topology:
    """What a mesh is as a combinatorial surface."""

    num_vertices: int  # vertices that have a face
    num_faces: int  # triangles
    unused_vertices: int  # vertices without a face
    boundary_edges: int  # edges with one face
    boundary_loops: int  # closed chains of boundary edges; where chains touch, one piece counts once
    non_manifold_edges: int  # edges with more than two faces
    pinched_vertices: int  # vertices whose faces are not one fan
    miswound_edges: int  # directed edges that more than one face uses
    components: int  # parts connected by edges
    euler_number: int  # vertices - edges + faces

    @property
    def is_manifold(self) -> bool:
        """Whether the mesh is a consistently wound two-manifold, with or without boundary."""
        return not (self.non_manifold_edges or self.pinched_vertices or self.miswound_edges)


@dataclass(frozen=True)
class Quality:
    """Everything measured of one mesh; distances in meters, None where there was nothing to measure against.

    Attributes:
        topology: counts.
        area: surface area [m²].
        self_intersections: pairs of faces, without a common edge, that intersect.
        folds: edges at which the surface doubles back: the normals of their faces differ by more than 120 degrees.
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
    min_angle: float
    slivers: float
    cloud_to_mesh: Distances | None = None
    truth_to_mesh: Distances | None = None
    mesh_to_truth: Distances | None = None
    hausdorff: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return plain nested dicts, ready for JSON."""
        return asdict(self)


def measure_quality(
    mesh: trimesh.Trimesh,
    points: Num[np.ndarray, "N 3"] | None = None,
    truth: trimesh.Trimesh | None = None,
    *,
    num_samples: int = NUM_AREA_SAMPLES,
) -> Quality:
    """Measure a mesh, and its distances to the data and to the true surface.

    Args:
        mesh: the surface to measure.
        points: the cloud it was made from [m].
        truth: the true surface.
        num_samples: points spread over the area of a surface for the distances between surfaces.

    Returns:
        The same numbers for the same arguments: the samples are drawn with a fixed seed.
    """
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    areas = compute_areas(vertices, faces)
    angles = _find_angles(vertices, faces)
    intersections, folds = find_intersections(vertices, faces), find_folded_edges(vertices, faces)
    distances: dict[str, Distances | float] = {}
    if points is not None and len(points) and len(faces):
        distances["cloud_to_mesh"] = _summarize(compute_distances(points, vertices, faces))
    if truth is not None and len(faces):
        true_vertices = np.asarray(truth.vertices, dtype=np.float64)
        true_faces = np.asarray(truth.faces, dtype=np.int64)
        on_truth = sample_area(true_vertices, true_faces, num_samples)
        on_mesh = sample_area(vertices, faces, num_samples)
        there = _summarize(compute_distances(on_truth, vertices, faces))
        back = _summarize(compute_distances(on_mesh, true_vertices, true_faces))
        distances |= {"truth_to_mesh": there, "mesh_to_truth": back, "hausdorff": max(there.max, back.max)}
    return Quality(
        topology=count_topology(faces, len(vertices)),
        area=float(areas.sum()),
        self_intersections=len(intersections),
        folds=len(folds),
        min_angle=float(angles.min(axis=1).mean()) if len(faces) else 0.0,
        slivers=float((angles.min(axis=1) < SLIVER_ANGLE).mean()) if len(faces) else 0.0,
        **distances,  # pyright: ignore[reportArgumentType]
    )


def compute_distances(
    points: Num[np.ndarray, "N 3"], vertices: Num[np.ndarray, "V 3"], faces: Faces
) -> Float[np.ndarray, " N"]:
    """Return the exact distance of every point to the nearest point of the faces, by libigl."""
    import igl

    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
    )
    return np.sqrt(np.maximum(squared, 0))


def count_topology(faces: Faces, num_vertices: int) -> Topology:
    """Count what makes, or spoils, a two-manifold."""
    faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    sides = group_sides(faces, num_vertices)
    edges = np.stack(np.divmod(sides.keys, max(num_vertices, 1)), axis=1)
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    _, uses = np.unique(tails * num_vertices + heads, return_counts=True)
    used, boundary = np.unique(faces), edges[sides.counts == 1]
    parts = _count_parts(edges, num_vertices) - (num_vertices - len(used))
    return Topology(
        num_vertices=len(used),
        num_faces=len(faces),
        unused_vertices=num_vertices - len(used),
        boundary_edges=len(boundary),
        boundary_loops=_count_parts(boundary, num_vertices) - (num_vertices - len(np.unique(boundary))),
        non_manifold_edges=int((sides.counts > 2).sum()),
        pinched_vertices=len(find_pinched(faces)),
        miswound_edges=int((uses > 1).sum()),
        components=parts,
        euler_number=len(used) - len(edges) + len(faces),
    )


def find_pinched(faces: Faces) -> Int[np.ndarray, " P"]:
    """Return the vertices whose faces are not one fan joined by edges, by libigl."""
    import igl

    if len(faces) == 0:
        return np.empty(0, dtype=np.int64)
    is_pinched = np.logical_not(igl.is_vertex_manifold(faces))
    is_used = np.zeros(len(is_pinched), dtype=bool)
    is_used[faces] = True
    return np.flatnonzero(is_pinched & is_used)


def _count_parts(edges: Int[np.ndarray, "E 2"], num_vertices: int) -> int:
    """Return the number of connected parts; a vertex without an edge is one."""
    return int(label_parts(edges, num_vertices).max(initial=-1)) + 1


def _find_angles(vertices: Vertices, faces: Faces) -> Float[np.ndarray, "F 3"]:
    """Return the angle at every corner [rad]."""
    corners = vertices[faces]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.arctan2(compute_lengths(cross_rows(ahead, behind)), sum_rows(ahead * behind))


def _summarize(distances: Float[np.ndarray, " N"]) -> Distances:
    return Distances(float(distances.mean()), float(np.percentile(distances, 95)), float(distances.max()))
