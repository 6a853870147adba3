"""Small clouds of known surfaces."""

import numpy as np
import trimesh


def sample_mesh(mesh: trimesh.Trimesh, number: int, noise: float, seed: int = 0) -> np.ndarray:
    """Return noisy points of a mesh."""
    points = np.asarray(trimesh.sample.sample_surface(mesh, number, seed=seed)[0])
    return points + np.random.default_rng(seed).normal(size=points.shape) * noise


def make_sheet(number: int = 8000, noise: float = 0.003, seed: int = 0) -> np.ndarray:
    """Return points of a wavy sheet, 2 by 1."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1, 1, number), rng.uniform(-0.5, 0.5, number)
    points = np.stack([x, y, 0.15 * np.sin(3 * x) * np.cos(2 * y)], axis=1)
    return points + rng.normal(size=points.shape) * noise


def make_trench(number: int = 20000, noise: float = 0.003, seed: int = 0) -> np.ndarray:
    """Return points of a level ground with a trench across it: vertical walls, sharp edges."""
    profile = np.array([[-1.0, 0.0], [-0.2, 0.0], [-0.2, -0.25], [0.2, -0.25], [0.2, 0.0], [1.0, 0.0]])
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))]
    rng = np.random.default_rng(seed)
    along = rng.uniform(0, length[-1], number)
    points = np.stack(
        [
            np.interp(along, length, profile[:, 0]),
            rng.uniform(-0.5, 0.5, number),
            np.interp(along, length, profile[:, 1]),
        ],
        axis=1,
    )
    return points + rng.normal(size=points.shape) * noise


def make_floor(side: int = 21, size: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a flat square, so many vertices along a side, one corner at the origin."""
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    lower = np.stack([corner, corner + side, corner + side + 1], axis=1)
    upper = np.stack([corner, corner + side + 1, corner + 1], axis=1)
    vertices = size / (side - 1) * np.stack([x.ravel(), y.ravel(), np.zeros(side**2)], axis=1)
    return vertices, np.concatenate([lower, upper])


def read_floor(number: int, seed: int = 0) -> np.ndarray:
    """Return readings of that square, with a noise of 3 mm."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0, 2, (number, 2)), rng.normal(0, 0.003, number)])
