"""What is searched: the readings of a cloud, a scan log, a reconstruction or a mesh, thinned to even cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.input_cloud import make_cloud
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import make_log_cloud
from reconstruction._src.scans.scan import ScanLog

if TYPE_CHECKING:
    import trimesh

_MAX_SAMPLES = 2_000_000
"""A mesh is sampled with no more points than this."""


class Cells(NamedTuple):
    """Readings averaged in cells.

    Attributes:
        points: `[C, 3]` means [m].
        counts: `[C]` readings of each.
        viewpoint: `[C]` index of a viewpoint that saw the cell; -1 where none is known.
    """

    points: Float[np.ndarray, "C 3"]
    counts: Int[np.ndarray, " C"]
    viewpoint: Int[np.ndarray, " C"]


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
