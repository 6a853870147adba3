"""What is searched: the readings of a cloud, a scan log, a reconstruction or a mesh, thinned to even cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.input_cloud import make_cloud
from reconstruction._src.objects.model import SPACING, ObjectModel, compute_spread
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import make_log_cloud
from reconstruction._src.scans.scan import ScanLog

if TYPE_CHECKING:
    import trimesh

_MAX_SAMPLES = 2_000_000  # A mesh is sampled with no more points than this


class Cells(NamedTuple):
    """Readings averaged in cells."""

    points: Float[np.ndarray, "C 3"]  # means [m]
    counts: Int[np.ndarray, " C"]  # readings of each
    viewpoint: Int[np.ndarray, " C"]  # index of a viewpoint that saw the cell; -1 where none is known


def read_scan(scan: Any, spacing: float, seed: int) -> tuple[Cloud, Float[np.ndarray, "N 3"] | None]:
    """Return what is searched as a cloud near the origin of its frame, and the normals of a mesh at its points."""
    from reconstruction._src.reconstruction import Reconstruction

    normals = None
    if isinstance(scan, Reconstruction):
        scan = scan.readings
    elif isinstance(scan, ScanLog):
        scan = make_log_cloud(scan)
    elif hasattr(scan, "faces") and hasattr(scan, "vertices"):
        scan, normals = _sample_mesh(scan, spacing, seed)
    return make_cloud(scan), normals


def _sample_mesh(mesh: trimesh.Trimesh, spacing: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    from reconstruction._src.geometry.sampling import sample_surface

    if not len(mesh.faces):
        raise ReconstructionError("the mesh that is searched has no faces")
    count = int(np.clip(4 * float(mesh.area) / spacing**2, 100, _MAX_SAMPLES))
    points, faces = sample_surface(mesh, count, seed)
    return points, np.asarray(mesh.face_normals)[faces]


def make_cells(cloud: Cloud, spacing: float) -> Cells:
    """Average the readings in cells of a width [m]."""
    low = cloud.points.min(axis=0)
    index = np.floor((cloud.points - low) / spacing).astype(np.int64)
    shape = index.max(axis=0) + 1
    key = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=ordered[0] - 1))
    counts = np.diff(starts, append=len(key))
    sums = np.add.reduceat(cloud.points[order], starts, axis=0)
    seen_from = (
        np.full(len(starts), -1, np.int64) if cloud.seen_from is None else cloud.seen_from[order[starts]]
    )
    return Cells(sums / counts[:, None], counts, seen_from)


_GAP = 2.5  # Cells closer than this many spacings belong together
_MIN_EXTENT = 0.5  # What is smaller than this share of the object's radius is no part of it
_MIN_SPREAD = 0.4  # Along each principal axis a region is as wide as this share of the object


class Region(NamedTuple):
    """A part of the scan that may hold an object."""

    center: Float[np.ndarray, " 3"]  # [m]
    rows: Int[np.ndarray, " M"]  # cells that are not background, within a diameter


def find_regions(points: Float[np.ndarray, "C 3"], model: ObjectModel) -> list[Region]:
    """Return the regions in which an object is searched.

    Parts smaller than the object give one region; larger ones are covered by several that overlap.
    """
    if len(points) < 8:
        return []
    tree = cKDTree(points)
    pairs = tree.query_pairs(_GAP * SPACING, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), tuple(pairs.T)), shape=(len(points), len(points)))
    count, part = connected_components(graph, directed=False)
    order = np.argsort(part, kind="stable")
    regions: list[Region] = []
    for rows in np.split(order, np.cumsum(np.bincount(part, minlength=count))[:-1]):
        if len(rows) >= 12 and np.ptp(points[rows], axis=0).max() >= _MIN_EXTENT * model.radius:
            regions += _cover(points, rows, tree, model.radius)
    return [each for each in regions if _may_hold(points, each, model)]


def _may_hold(points: np.ndarray, region: Region, model: ObjectModel) -> bool:
    """Return whether what is near the center is no thinner than half the object, as edges and flat sides are."""
    near = points[region.rows]
    near = near[np.linalg.norm(near - region.center, axis=1) <= model.radius]
    return len(near) >= 12 and bool((compute_spread(near) >= _MIN_SPREAD * model.spread).all())


def _cover(points: np.ndarray, rows: np.ndarray, tree: cKDTree, radius: float) -> list[Region]:
    """Return regions around places of a part, a radius apart, until all of it is covered."""
    middle = (points[rows].min(axis=0) + points[rows].max(axis=0)) / 2
    if np.linalg.norm(points[rows] - middle, axis=1).max() <= 1.3 * radius:
        return [Region(middle, np.sort(np.array(tree.query_ball_point(middle, 1.5 * radius), np.int64)))]
    regions, left = [], rows
    while len(left):
        seed = points[left[int(np.argmin(points[left] @ np.array([1.0, 0.618, 0.382])))]]
        near = np.linalg.norm(points[left] - seed, axis=1) <= radius
        center = points[left[near]].mean(axis=0)
        inside = np.sort(np.array(tree.query_ball_point(center, 1.4 * radius), np.int64))
        if len(inside) >= 12:
            regions.append(Region(center, inside))
        left = left[~near]
    return regions
