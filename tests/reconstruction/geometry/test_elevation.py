"""Heights along vertical lines."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.elevation import Elevation


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


def test_height_below_a_limit_is_that_of_the_storey_below():
    boxes = [trimesh.creation.box((2.0, 2.0, 0.1)) for _ in range(2)]
    boxes[1].apply_translation((0.0, 0.0, 2.0))
    both = Elevation(*boxes)
    x = np.array([0.3, 0.3, 0.3, 5.0])
    found = both.height_below(x, 0.2, np.array([1.0, 3.0, -1.0, 1.0]))
    assert found[:2] == pytest.approx([0.05, 2.05])
    assert np.isnan(found[2:]).all()
    assert both.height_below(0.3, 0.2, 2.0) == pytest.approx(1.95)
    assert both.height_below(x, 0.2, np.inf)[:3] == pytest.approx(both.height(x, 0.2)[:3])
