"""Which points lie in a box."""

import numpy as np

from reconstruction._src.geometry.rows import find_inside, find_near_box


def test_the_box_contains_its_sides_and_nothing_beyond():
    points = np.array([[0, 0, 0], [1, 1, 1], [0.5, 0.5, 1.01], [-0.01, 0, 0], [0.5, 2, 0.5]], dtype=float)
    assert find_inside(points, np.zeros(3), np.ones(3)).tolist() == [0, 1]
    assert find_near_box(points, points[:2], 0.02).tolist() == [0, 1, 2, 3]


def test_as_by_definition():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(1000, 3))
    low, high = np.array([-0.5, -1.0, 0.0]), np.array([0.7, 0.2, 2.0])
    expected = ((points >= low) & (points <= high)).all(axis=1)
    np.testing.assert_array_equal(find_inside(points, low, high), np.flatnonzero(expected))
