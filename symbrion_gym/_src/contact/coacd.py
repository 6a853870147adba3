"""A closed solid as convex pieces, by coacd in a process of its own."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.contact.simplification import simplify_surface
from symbrion_gym._src.errors import ArenaError

MAX_HULL_VERTICES = 64  # Corners of a piece: fewer cost less in every contact
_MIN_VOLUME = 1e-6  # Smaller pieces are dropped: slivers between cuts [m³]
_MAX_FACES = 1000  # Larger solids are simplified first: its time grows faster than the number of faces
_OPTIONS = {
    "threshold": 0.02,  # concavity left, relative to half the longest extent
    "max_ch_vertex": MAX_HULL_VERTICES,
    "max_convex_hull": -1,  # as many pieces as it takes
    "preprocess_mode": "off",  # its own remeshing inflates the solid by millimeters
    "mcts_iterations": 60,  # of its tree search
    "mcts_max_depth": 2,
    "mcts_nodes": 10,
    "resolution": 1000,  # points on which a cut is rated
}
_TIME_LIMIT = 300.0  # Emergency stop: no arena is made then [s]
_WORKER = Path(__file__).with_name("coacd_worker.py")


class OutOfTimeError(ArenaError):
    """coacd ran longer than it may."""


def decompose(solid: trimesh.Trimesh, seed: int) -> list[trimesh.Trimesh]:
    """Decompose a closed solid into convex pieces.

    coacd runs in a process of its own: whatever happens to it, the caller lives.

    References:
        Wei, Liu, Ling, Su (2022), Approximate convex decomposition for 3D meshes with collision-aware
        concavity and tree search.
    """
    solid = simplify_surface(solid, _MAX_FACES)
    with tempfile.TemporaryDirectory(prefix="symbrion-coacd-") as folder:
        source, target = Path(folder) / "solid.npz", Path(folder) / "pieces.npz"
        options = json.dumps({**_OPTIONS, "seed": seed})
        np.savez(source, vertices=solid.vertices, faces=solid.faces, options=options)
        # As a file, not as a module: that would import the package itself, which takes a second.
        command = [sys.executable, "-P", str(_WORKER), str(source), str(target)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=_TIME_LIMIT, check=False)
        except subprocess.TimeoutExpired as error:
            raise OutOfTimeError(
                f"coacd took longer than {_TIME_LIMIT:g} s on {len(solid.faces)} faces; give a simpler body"
            ) from error
        if done.returncode or not target.is_file():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise ArenaError(f"coacd failed on {len(solid.faces)} faces (exit {done.returncode}): {last}")
        with np.load(target, allow_pickle=False) as arrays:
            parts = [arrays[f"vertices_{i}"] for i in range(int(arrays["count"]))]
    pieces = [piece for vertices in parts if (piece := make_piece(vertices)) is not None]
    if not pieces:
        raise ArenaError(f"coacd found no piece with a volume in {len(solid.faces)} faces")
    return pieces


def make_piece(points: Float[np.ndarray, "N 3"]) -> trimesh.Trimesh | None:
    """Return the convex hull of points, of at most 64 vertices; None where it is flat."""
    hull = make_hull(points)
    if hull is not None and len(hull.vertices) > MAX_HULL_VERTICES:
        hull = make_hull(_take_extremes(np.asarray(hull.vertices)))
    return hull if hull is not None and hull.volume > _MIN_VOLUME else None


def _take_extremes(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "M 3"]:
    """Return the points farthest out, each farthest from those taken before."""
    taken = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(points - points[taken[0]], axis=1)
    while len(taken) < MAX_HULL_VERTICES:
        taken.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[taken[-1]], axis=1))
    return points[taken]
