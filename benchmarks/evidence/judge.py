"""Independent judgment of surfaces and contact: distances by libigl, rays by MuJoCo on the compiled model."""

from __future__ import annotations

import igl
import mujoco
import numpy as np
import trimesh

import symbrion_gym as sg

CONTACT, SURFACE = 3, 2
"""Groups of geoms of an arena: what robots touch, and what rays meet."""
NEAR = 0.05
"""A beam that ends within this of its reading ends where it did [m]."""


def measure_distances(points: np.ndarray, mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the distance of each point to a mesh [m]."""
    return np.linalg.norm(find_closest(points, mesh) - points, axis=1)


def find_closest(points: np.ndarray, mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the point of a mesh that is closest to each point, `[N, 3]` [m]."""
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    return igl.point_mesh_squared_distance(np.ascontiguousarray(points, float), vertices, faces)[2]


def sample(mesh: trimesh.Trimesh, count: int, seed: int = 0) -> np.ndarray:
    """Return points spread evenly over a mesh, `[count, 3]` [m]."""
    return np.asarray(trimesh.sample.sample_surface(mesh, count, seed=seed)[0])


class Casts:
    """Rays in a model, by MuJoCo's own functions on its compiled model.

    Args:
        spec: of the arena.
    """

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)

    def cast(self, origins: np.ndarray, directions: np.ndarray, group: int) -> np.ndarray:
        """Return how far each ray goes to geoms of a group [m]; inf where it meets none."""
        groups = np.zeros(6, np.uint8)
        groups[group] = 1
        hit = np.zeros(1, np.int32)
        found = [
            mujoco.mj_ray(self._model, self._data, origin, direction, groups, 1, -1, hit)
            for origin, direction in zip(origins, directions, strict=True)
        ]
        return np.where(np.array(found) < 0, np.inf, found)

    def measure_heights(self, places: np.ndarray, group: int, top: float = 50.0) -> np.ndarray:
        """Return the height of the ground at (x, y) [m]; nan where there is none."""
        origins = np.column_stack([places, np.full(len(places), top)])
        found = self.cast(origins, np.tile([0.0, 0.0, -1.0], (len(places), 1)), group)
        return np.where(np.isfinite(found), top - found, np.nan)


def judge_beams(
    arena: sg.Arena, viewpoint: np.ndarray, readings: np.ndarray, count: int = 4000
) -> dict[str, float]:
    """Compare beams in an arena with readings of a scan, in percent.

    Args:
        arena: made of the scan.
        viewpoint: `[3]` place of the scanner, in the arena's frame [m].
        readings: `[N, 3]` likewise.
        count: beams that are compared, drawn evenly.

    Returns:
        `contact` and `surface`: beams that end within 5 cm of their reading; `blocked`: beams that contact stops
        earlier.
    """
    chosen = readings[np.random.default_rng(0).permutation(len(readings))[:count]]
    ways = chosen - viewpoint
    ranges = np.linalg.norm(ways, axis=1)
    origins, directions = np.tile(viewpoint, (len(chosen), 1)), ways / ranges[:, None]
    casts = Casts(arena.spec())
    ends = {
        name: casts.cast(origins, directions, group)
        for name, group in (("contact", CONTACT), ("surface", SURFACE))
    }
    shares = {name: 100 * float(np.mean(np.abs(end - ranges) < NEAR)) for name, end in ends.items()}
    return shares | {"blocked": 100 * float(np.mean(ends["contact"] < ranges - NEAR))}
