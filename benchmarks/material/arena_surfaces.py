"""Surfaces from which arenas are made: scans of the course by the networks, other courses, the real staircase."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.formats import load_points
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.surface_file import load_surface

STAIRS = Path(__file__).resolve().parents[3] / "shared" / "data" / "octomap_stairs_scan.dat.bz2"
BUNNY = STAIRS.with_name("stanford-bunny.obj")
RESOLUTIONS = {
    "gsrm 800": ("gsrm", 800),
    "gsrm 2200": ("gsrm", 2200),
    "gsrm 5000": ("gsrm", 5000),
    "gg 1500": ("gg", 800),
    "gg": ("gg", 7000),
}
"""Network and units; "gg" has about 13,900 triangles, "gg 1500" about 1,500."""
MAIN = ("gsrm 800", "gsrm 2200", "gg")
SLANTED_PIT = [(-3, 0), (-1.7, 0), (-0.7, 0.25), (-0.3, 0.25), (-0.1, 0), (0.15, 0), (0.3, 0.25), (0.7, 0.25)]
SLANTED_PIT += [(1.7, 0), (3, 0)]


@cache
def scan_course(pit: float, name: str) -> trimesh.Trimesh:
    """Scan the course with a pit of this width [m] and reconstruct it with a network of `RESOLUTIONS`."""
    method, units = RESOLUTIONS[name]
    return reconstruct(_sample(Course(pit=pit).surface()), method, units=units).mesh


def map_stairs() -> trimesh.Trimesh | None:
    """Reconstruct the stairs of the real scan (see the README of the data); None if it is missing."""
    if not STAIRS.is_file():
        return None
    points = load_points(STAIRS)
    low, high = np.array([0.4, -4.3, -np.inf]), np.array([9.6, 1.4, 2.0])
    return reconstruct(points[((points > low) & (points < high)).all(axis=1)], units=2200).mesh


def load_bunny() -> trimesh.Trimesh | None:
    """Read the bunny unchanged, with its holes; None if it is missing."""
    return load_surface(BUNNY) if BUNNY.is_file() else None


def make_other_profiles() -> dict[str, np.ndarray]:
    """Return other profiles: a slanted pit, a hump, steps, hills."""
    x = np.linspace(-0.5, 0.5, 60)
    hump = [(-2.5, 0), *zip(x, 0.1 * (1 + np.cos(2 * np.pi * x)), strict=True), (2.5, 0)]
    far = np.linspace(-3.0, 3.0, 240)
    hills = np.column_stack([far, 0.1 * np.sin(2.0 * far) + 0.05 * np.cos(3.5 * far + 1.0)])
    steps = StairsCourse(rise=0.1).profile()
    return {"slanted pit": np.array(SLANTED_PIT), "hump": np.array(hump), "steps": steps, "hills": hills}


def turn(mesh: trimesh.Trimesh, yaw: float) -> trimesh.Trimesh:
    """Return a copy rotated about z [rad]."""
    return mesh.copy().apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))


def _sample(surface: trimesh.Trimesh, count: int = 60_000, noise: float = 0.005, seed: int = 0) -> np.ndarray:
    points = np.asarray(trimesh.sample.sample_surface(surface, count, seed=seed)[0])
    return points + np.random.default_rng(seed).normal(scale=noise, size=(count, 3))
