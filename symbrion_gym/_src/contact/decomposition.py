"""A closed solid as convex pieces, by coacd in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.errors import ArenaError

MIN_VOLUME = 1e-6  # coacd's smaller pieces are dropped: slivers between cuts [m³]
_FLAT_VOLUME = 1e-10
"""A solid with less after rounding to single precision, as MuJoCo stores it, is flat [m³]."""
MAX_HULL_VERTICES = 64  # Corners of a piece: fewer cost less in every contact
_LONGEST = 1e6  # A process can be waited for this long; longer limits are none (11 days) [s]
_WORKER = Path(__file__).with_name("coacd_worker.py")


def decompose(
    solid: trimesh.Trimesh,
    threshold: float = 0.05,
    seed: int = 0,
    time_limit: float = 60.0,
    **options: Any,
) -> list[trimesh.Trimesh]:
    """Decompose a closed solid into convex pieces.

    coacd runs in a process of its own: whatever happens to it, the caller lives.

    References:
        Wei, Liu, Ling, Su (2022), Approximate convex decomposition for 3D meshes with collision-aware
        concavity and tree search.
    """
    options = {"threshold": threshold, "seed": seed, "max_ch_vertex": MAX_HULL_VERTICES, **options}
    with tempfile.TemporaryDirectory(prefix="symbrion-coacd-") as folder:
        source, target = Path(folder) / "solid.npz", Path(folder) / "pieces.npz"
        np.savez(source, vertices=solid.vertices, faces=solid.faces, options=json.dumps(options))
        # As a file, not as a module: that would import the package itself, which takes a second.
        command = [sys.executable, "-P", str(_WORKER), str(source), str(target)]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=min(time_limit, _LONGEST), check=False
            )
        except subprocess.TimeoutExpired as error:
            raise ArenaError(
                f"coacd took longer than {time_limit:g} s on {len(solid.faces)} faces; simplify the mesh, "
                "ask for less accuracy or allow more time"
            ) from error
        if done.returncode or not target.is_file():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise ArenaError(f"coacd failed on {len(solid.faces)} faces (exit {done.returncode}): {last}")
        with np.load(target, allow_pickle=False) as arrays:
            parts = [(arrays[f"vertices_{i}"], arrays[f"faces_{i}"]) for i in range(int(arrays["count"]))]
    pieces = [piece for vertices, _ in parts if (piece := make_piece(vertices)) is not None]
    if not pieces:
        raise ArenaError(f"coacd found no piece with a volume in {len(solid.faces)} faces")
    return pieces


def make_piece(points: Float[np.ndarray, "N 3"]) -> trimesh.Trimesh | None:
    """Return the convex hull of points, of at most 64 vertices; None where it is flat."""
    hull = make_hull(points)
    if hull is not None and len(hull.vertices) > MAX_HULL_VERTICES:
        hull = make_hull(_take_extremes(np.asarray(hull.vertices)))
    return hull if hull is not None and hull.volume > MIN_VOLUME else None


def is_solid(hull: trimesh.Trimesh) -> bool:
    """Return whether a convex hull still has a volume in single precision: MuJoCo refuses flat ones."""
    rounded = make_hull(np.asarray(hull.vertices, dtype=np.float32))
    return rounded is not None and bool(rounded.volume > _FLAT_VOLUME)


def _take_extremes(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "M 3"]:
    """Return the points farthest out, each farthest from those taken before."""
    taken = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(points - points[taken[0]], axis=1)
    while len(taken) < MAX_HULL_VERTICES:
        taken.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[taken[-1]], axis=1))
    return points[taken]


_LEAST_MASS = 1e-300  # Keeps divisions by the area of no faces finite


def compute_moments(mesh: trimesh.Trimesh, origin: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "F 4 4"]:
    """Return the integral of h hᵀ over every face, h = (x - origin, 1)."""
    corners = np.asarray(mesh.triangles, dtype=np.float64) - origin
    homogeneous = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    total = homogeneous.sum(axis=1)
    # Over a triangle of area A it is A/12 (sum of h hᵀ over the corners + s sᵀ), s the sum of their h.
    moments = np.einsum("fki,fkj->fij", homogeneous, homogeneous) + total[:, :, None] * total[:, None, :]
    return moments * (np.asarray(mesh.area_faces, dtype=np.float64)[:, None, None] / 12.0)


def fit_planes(
    moments: Float[np.ndarray, "*N 4 4"],
) -> tuple[Float[np.ndarray, "*N 3"], Float[np.ndarray, " *N"], Float[np.ndarray, " *N"]]:
    """Return least-squares planes of moments: normals of either sign, offsets and standard deviations [m]."""
    mass = np.maximum(moments[..., 3, 3], _LEAST_MASS)
    center = moments[..., :3, 3] / mass[..., None]
    spread = moments[..., :3, :3] / mass[..., None, None] - center[..., :, None] * center[..., None, :]
    values, vectors = np.linalg.eigh(spread)
    normal = vectors[..., 0]
    offset = np.asarray(np.sum(normal * center, axis=-1))
    return normal, offset, np.asarray(np.sqrt(np.maximum(values[..., 0], 0.0)))


def measure_deviations(
    moments: Float[np.ndarray, "N 4 4"], normal: Float[np.ndarray, " 3"], offset: float
) -> Float[np.ndarray, " N"]:
    """Return root-mean-square distances of moments from one plane [m]."""
    plane = np.append(normal, -offset)
    square = np.einsum("nij,i,j->n", moments, plane, plane)
    return np.sqrt(np.maximum(square, 0.0) / np.maximum(moments[:, 3, 3], _LEAST_MASS))


def weigh_faces(
    labels: Int[np.ndarray, " F"], pairs: Int[np.ndarray, "P 2"], border_weight: float
) -> Float[np.ndarray, " F"]:
    """Return how much each face counts in the plane of its region: little at the border, not at all without one."""
    weights = np.ones(len(labels))
    weights[pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]].ravel()] = border_weight
    return weights * (labels >= 0)
