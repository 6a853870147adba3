"""Folded faces are found, and laid flat."""

import numpy as np
import pytest

from reconstruction.surfaces.unfolding import find_folded, unfold_faces


def make_lattice(size: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Return a flat square lattice, `[size², 3]` and its faces."""
    x, y = np.meshgrid(np.arange(size, dtype=float), np.arange(size, dtype=float), indexing="ij")
    index = np.arange(size * size).reshape(size, size)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces


def test_a_flat_lattice_has_no_folds_and_stays():
    vertices, faces = make_lattice()
    assert not find_folded(vertices, faces).any()
    np.testing.assert_array_equal(unfold_faces(vertices, faces), vertices)


@pytest.mark.parametrize("vertex", [24, 3])  # the middle; the rim
def test_a_vertex_beyond_its_neighbours_comes_back(vertex):
    vertices, faces = make_lattice()
    spoiled = vertices.copy()
    spoiled[vertex, :2] += [1.6, 0.3]
    assert find_folded(spoiled, faces).any()
    mended = unfold_faces(spoiled, faces)
    assert not find_folded(mended, faces).any()
    np.testing.assert_allclose(mended[:, 2], 0, atol=1e-12)
    is_far = np.abs(vertices - vertices[vertex]).max(axis=1) > 2.5
    np.testing.assert_array_equal(mended[is_far], vertices[is_far])
