"""Other ways to contact geometry of the same surface: coacd as it is, prisms of a decimated mesh, a height field."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from benchmarks.material.array_files import load_arrays, save_arrays
from benchmarks.material.scan_sources import ScanCase
from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.kinds import make_height_field
from symbrion_gym._src.contact.quality import ArenaQuality

THICKNESS = 0.06
"""How thick prisms of a decimated mesh are [m]."""
COACD_LIMIT = 120.0
"""Coacd is ended after this time [s]."""
_LEAST_AREA = 1e-7
"""Triangles with less make prisms that MuJoCo refuses as flat [m²]."""

_COACD = """
import sys, coacd, numpy as np
coacd.set_log_level("error")
with np.load(sys.argv[1]) as held:
    parts = coacd.run_coacd(coacd.Mesh(held["vertices"], held["faces"]))
np.savez(sys.argv[2], **{str(number): part[0] for number, part in enumerate(parts)})
"""


class PeerFailedError(Exception):
    """A peer gave no contact geometry; the message says why."""


def make_coacd(case: ScanCase, surface: trimesh.Trimesh) -> Arena:
    """Decompose the surface by coacd with its own defaults.

    Raises:
        PeerFailedError: it failed, or took too long.
    """
    del case
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        save_arrays(source, {"vertices": surface.vertices, "faces": surface.faces})
        try:
            subprocess.run(
                [sys.executable, "-c", _COACD, str(source), str(target)],
                check=True,
                timeout=COACD_LIMIT,
                capture_output=True,
            )
        except subprocess.TimeoutExpired as error:
            raise PeerFailedError(f"longer than {COACD_LIMIT:.0f} s") from error
        except subprocess.CalledProcessError as error:
            raise PeerFailedError(f"exit code {error.returncode}") from error
        pieces = [trimesh.convex.convex_hull(points) for points in load_arrays(target).values()]
    return _as_arena("coacd", pieces, surface)


def make_prisms(case: ScanCase, surface: trimesh.Trimesh, num_triangles: int) -> Arena:
    """Decimate the surface and thicken each triangle away from where it was seen; up, or outwards, if unknown."""
    mesh = surface
    if len(surface.faces) > num_triangles:
        mesh = surface.simplify_quadric_decimation(face_count=num_triangles)
    triangles, normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
    if case.origins is not None:
        nearest = cKDTree(case.points).query(triangles.mean(axis=1))[1]
        towards = np.einsum("ij,ij->i", normals, case.origins[nearest] - triangles.mean(axis=1))
        normals = np.where(towards[:, None] < 0, -normals, normals)
    backs = triangles - THICKNESS * normals[:, None]
    pieces = [
        trimesh.convex.convex_hull(np.concatenate(pair))
        for pair, area in zip(zip(triangles, backs, strict=True), mesh.area_faces, strict=True)
        if area > _LEAST_AREA
    ]
    return _as_arena(f"prisms {num_triangles}", pieces, surface)


def make_hfield(case: ScanCase, surface: trimesh.Trimesh) -> Arena:
    """Sample the surface from above."""
    del case
    field = make_height_field(surface, Elevation(surface))
    return Arena("hfield", [], surface, ArenaQuality(0.0, 0.0, 0.0, 1), kind="hfield", height_field=field)


PEERS: dict[str, Callable[[ScanCase, trimesh.Trimesh], Arena]] = {
    "prisms 500": lambda case, surface: make_prisms(case, surface, 500),
    "prisms 2000": lambda case, surface: make_prisms(case, surface, 2000),
    "hfield": make_hfield,
    "coacd": make_coacd,
}


def time_peer(name: str, case: ScanCase, surface: trimesh.Trimesh) -> tuple[Arena, dict[str, Any]]:
    """Make a peer's arena; return it with the time that it took.

    Raises:
        PeerFailedError: it gave none.
    """
    begin = time.perf_counter()
    try:
        arena = PEERS[name](case, surface)
    except PeerFailedError:
        raise
    except Exception as error:  # libraries fail in many ways on real meshes, and the others shall go on
        raise PeerFailedError(f"{type(error).__name__}: {error}") from error
    return arena, {"pieces": len(arena.pieces), "seconds": time.perf_counter() - begin}


def _as_arena(name: str, pieces: list[trimesh.Trimesh], surface: trimesh.Trimesh) -> Arena:
    return Arena(name, pieces, surface, ArenaQuality(0.0, 0.0, 0.0, len(pieces)))
