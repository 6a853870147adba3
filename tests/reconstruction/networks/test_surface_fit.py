"""The least-squares fit of a mesh to its samples."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from shapes import make_floor

from reconstruction._src.networks.surface_fit import fit_surface, make_ring
from reconstruction._src.surfaces.quality import compute_distances


def make_roof(half: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Return a sheet of vertices over a ridge along y that it cuts short: (vertices, faces)."""
    flat, faces = make_floor(2 * half, size=1.8)
    x, y = flat[:, 0] - 0.9, flat[:, 1] - 0.9
    return np.stack([x, y, -np.abs(x) - 0.03], axis=1), faces


def make_samples(num_samples: int = 8000, noise: float = 0.003, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (num_samples, 3))
    points[:, 2] = -np.abs(points[:, 0])
    return points + rng.normal(0, noise, points.shape)


def fit(vertices: np.ndarray, faces: np.ndarray, samples: np.ndarray) -> np.ndarray:
    return fit_surface(vertices, faces, samples, winners=cKDTree(vertices).query(samples)[1])


@pytest.mark.slow
def test_the_fit_brings_the_faces_to_the_samples_and_the_rim_out():
    vertices, faces = make_roof()
    samples = make_samples()
    fitted = fit(vertices, faces, samples)
    before, after = compute_distances(samples, vertices, faces), compute_distances(samples, fitted, faces)
    assert after.mean() < 0.3 * before.mean()
    assert fitted[:, 1].max() > 0.97
    assert vertices[:, 1].max() == pytest.approx(0.9)


@pytest.mark.slow
def test_outliers_hardly_matter():
    vertices, faces = make_roof()
    samples = make_samples()
    rng = np.random.default_rng(1)
    outliers = rng.uniform(-1, 1, (400, 3))
    clean = fit(vertices, faces, samples)
    spoiled = fit(vertices, faces, np.concatenate([samples, outliers]))
    assert np.linalg.norm(clean - spoiled, axis=1).mean() < 0.01


def test_the_unit_of_length_does_not_matter():
    vertices, faces = make_roof()
    samples = make_samples()
    small = fit(vertices, faces, samples)
    large = fit(1000 * vertices + 5000, faces, 1000 * samples + 5000)
    np.testing.assert_allclose(large, 1000 * small + 5000, atol=0.5)


def test_vertices_without_samples_or_faces_stay():
    vertices, faces = make_roof()
    lonely = np.concatenate([vertices, [[5.0, 5.0, 5.0]]])
    fitted = fit(lonely, faces, make_samples())
    np.testing.assert_array_equal(fitted[-1], lonely[-1])
    np.testing.assert_array_equal(fit(vertices, faces[:0], make_samples()), vertices)
    np.testing.assert_array_equal(fit(vertices, faces, np.zeros((0, 3))), vertices)


def test_the_ring_lists_each_face_at_each_of_its_vertices():
    sphere = trimesh.creation.icosphere(subdivisions=1)
    ring = make_ring(np.asarray(sphere.faces), len(sphere.vertices))
    listed = {(v, *pair) for v, row in enumerate(ring) for pair in row.tolist() if pair[0] >= 0}
    assert len(listed) == 3 * len(sphere.faces)
    assert all((b, c, a) in listed for a, b, c in listed)
