"""Point clouds of different shape, density and noise, most with the true surface they were drawn from."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.scans.cloud_file import load_points
from symbrion_gym._src.arenas.course import Course, StairsCourse

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
"""Folder of the real scans, which are not part of this repository."""


@dataclass(frozen=True)
class Cloud:
    """Points, and what is known of their surface.

    Attributes:
        points: `[N, 3]` [m].
        truth: the true surface, or None for a real scan.
        is_sheet: whether one sheet without holes can cover it, which the growing grid requires.
        euler_number: of the truth, or None if unknown.
        loops: boundary loops of the truth, or None if unknown.
    """

    points: np.ndarray
    truth: trimesh.Trimesh | None
    is_sheet: bool = True
    euler_number: int | None = 1
    loops: int | None = 1


def make_arena(num_points: int = 60_000, noise: float = 0.005, seed: int = 0) -> Cloud:
    """Make the cloud for which the targets are set: two ramps and a pit, evenly scanned."""
    return _draw(Course().surface(), num_points, noise, seed)


def make_far_arena(seed: int = 1) -> Cloud:
    """Make the arena scanned from one place: density falls with distance, 5 % outliers, 5 % duplicate points."""
    rng = np.random.default_rng(seed)
    cloud = _draw(Course().surface(), 200_000, 0.004, seed)
    distance = np.linalg.norm(cloud.points - [-2.0, 0.0, 1.0], axis=1)
    points = cloud.points[rng.random(len(cloud.points)) < np.minimum(1, 0.5 / distance**1.5)]
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
    outliers = rng.uniform(low, high, (len(points) // 20, 3))
    return Cloud(np.concatenate([points, points[: len(points) // 20], outliers]), cloud.truth)


def make_steps(seed: int = 2) -> Cloud:
    """Make five low steps with 10 mm noise."""
    return _draw(StairsCourse(rise=0.12).surface(), 50_000, 0.010, seed)


def make_hills(seed: int = 3) -> Cloud:
    """Make hills a hundred meters across with 5 cm noise."""
    size, number = 100.0, 120
    x, y = np.meshgrid(np.linspace(0, size, number), np.linspace(0, size, number), indexing="ij")
    z = 6 * np.sin(x / 15) * np.cos(y / 11) + 3 * np.sin(x / 7 + y / 9)
    corner = (np.arange(number - 1)[:, None] * number + np.arange(number - 1)).ravel()
    lower = np.stack([corner, corner + number, corner + number + 1], axis=1)
    upper = np.stack([corner, corner + number + 1, corner + 1], axis=1)
    vertices = np.stack([x, y, z], axis=2).reshape(-1, 3)
    return _draw(trimesh.Trimesh(vertices, np.concatenate([lower, upper]), process=False), 40_000, 0.05, seed)


def make_sphere(seed: int = 4) -> Cloud:
    """Make a sphere of 1 m radius with 3 mm noise."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    return _draw(ball, 40_000, 0.003, seed, is_sheet=False, euler_number=2, loops=0)


def make_torus(seed: int = 5) -> Cloud:
    """Make a torus 1 mm thick without noise."""
    ring = trimesh.creation.torus(2.0, 0.5, major_sections=96, minor_sections=48)
    ring.apply_scale(0.001)
    return _draw(ring, 40_000, 0.0, seed, is_sheet=False, euler_number=0, loops=0)


def load_stairs() -> Cloud:
    """Load the staircase of OctoMap's scan; see the README of the data for the crop."""
    points = load_points(DATA / "octomap_stairs_scan.dat.bz2")
    is_near = (points > [0.4, -4.3, -np.inf]).all(axis=1) & (points < [9.6, 1.4, 2.0]).all(axis=1)
    return Cloud(points[is_near], None, euler_number=None, loops=None)


def load_bunny() -> Cloud:
    """Load the vertices of the Stanford bunny, whose surface has five holes at the bottom."""
    mesh = trimesh.load_mesh(DATA / "stanford-bunny.obj", process=False)
    return Cloud(np.asarray(mesh.vertices), mesh, is_sheet=False, euler_number=None, loops=None)


def load_room() -> Cloud:
    """Load a furnished room, scanned by one tilting scanner."""
    points = load_points(DATA / "libpointmatcher_apartment_cloud_0.vtk")
    return Cloud(points, None, is_sheet=False, euler_number=None, loops=None)


CLOUDS: dict[str, Callable[[], Cloud]] = {
    "arena": make_arena,
    "far arena": make_far_arena,
    "steps": make_steps,
    "hills": make_hills,
    "sphere": make_sphere,
    "torus": make_torus,
    "stairs scan": load_stairs,
    "bunny": load_bunny,
    "room scan": load_room,
}
REAL = ("stairs scan", "bunny", "room scan")


def _draw(truth: trimesh.Trimesh, num_points: int, noise: float, seed: int, **known) -> Cloud:
    points = sample_area(np.asarray(truth.vertices), np.asarray(truth.faces), num_points, seed)
    return Cloud(points + np.random.default_rng([seed, 1]).normal(0, noise, points.shape), truth, **known)
