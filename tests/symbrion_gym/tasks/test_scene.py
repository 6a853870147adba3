"""The greatest height of the ground nearby, which spares looking for the ground itself."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.tasks.scene import find_ceiling


def make_wall(x: float, height: float, length: float = 0.0) -> np.ndarray:
    """Return two triangles from the ground up to a height, along x as well if they have a length there [m]."""
    low, high = [[x, -1, 0], [x, 1, 0]], [[x + length, 1, height], [x + length, -1, height]]
    corners = np.array([*low, *high], dtype=float)
    return corners[[[0, 1, 2], [0, 2, 3]]]


def make_soup(*parts: np.ndarray) -> trimesh.Trimesh:
    triangles = np.concatenate(parts)
    return trimesh.Trimesh(
        triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False
    )


def find_highest(surface: trimesh.Trimesh, x: np.ndarray) -> np.ndarray:
    ends, ceiling = find_ceiling(surface)
    return ceiling[np.searchsorted(ends, x)]


def test_the_ceiling_is_the_greatest_height_nearby():
    tiles = [make_wall(x, 0.0, 0.02) for x in np.arange(0.0, 1.0, 0.02)]
    surface = make_soup(*tiles, make_wall(0.43, 1.0), make_wall(0.6, 2.0, 0.3))
    x = np.linspace(0, 1, 1001)
    highest = find_highest(surface, x)
    near_wall, on_slope = np.abs(x - 0.43) < 0.005, (x > 0.6) & (x < 0.9)
    apart = (np.abs(x - 0.43) > 0.055) & ((x < 0.545) | (x > 0.955))
    assert highest[near_wall] == pytest.approx(1.0, abs=1e-5)
    assert highest[on_slope] == pytest.approx(2.0, abs=1e-5)
    assert highest[apart] == pytest.approx(0.0, abs=1e-5)
    assert np.isneginf(find_highest(surface, np.array([-5.0, -0.11]))).all()


def test_what_stands_where_two_strips_meet_is_in_both():
    floor = make_wall(0.0, 0.0, 1.0)
    for end in find_ceiling(make_soup(floor))[0][1:-1]:
        highest = find_highest(make_soup(floor, make_wall(end, 1.0)), end + np.array([-1e-9, 0.0, 1e-9]))
        assert (highest >= 1.0).all()
