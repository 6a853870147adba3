"""Heights along vertical lines."""

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation


def test_highest_surface_answers_and_outside_is_nan():
    low, high = trimesh.creation.box((2.0, 2.0, 0.2)), trimesh.creation.box((0.5, 0.5, 1.0))
    heights, faces = Elevation(low, high).find_top(np.array([0.0, 0.9, 3.0, np.nan]), 0.0)
    np.testing.assert_allclose(heights[:2], [0.5, 0.1])
    assert np.isnan(heights[2:]).all()
    assert (faces[2:] == -1).all()
    assert (faces[:2] >= 0).all()


def test_agrees_with_a_known_function():
    x, y = np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 2, 30))
    i = (np.arange(29)[:, None] * 20 + np.arange(19)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 20], 1), np.stack([i + 1, i + 21, i + 20], 1)])
    mesh = trimesh.Trimesh(np.stack([x, y, 0.3 * x - 0.2 * y], -1).reshape(-1, 3), faces, process=False)
    points = np.random.default_rng(1).uniform([0, 0], [1, 2], size=(500, 2))
    np.testing.assert_allclose(Elevation(mesh).height(*points.T), points @ [0.3, -0.2], atol=1e-12)


def test_empty_has_no_heights():
    assert np.isnan(Elevation().height(np.array([0.0, 1.0]), 0.0)).all()
