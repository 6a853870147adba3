"""What rays go through is gone; rings of neighbors and connected parts."""

import numpy as np
import pytest

from reconstruction._src.geometry.manifold import spread, widen
from reconstruction._src.knowledge.changes import find_crossed_vertices, number_parts

MARGIN = 0.01
ABOVE = np.array([0.5, 0.5, 2.0])


@pytest.fixture(scope="module")
def board() -> tuple[np.ndarray, np.ndarray]:
    """A level board of 1 m x 1 m, eleven vertices a side."""
    x, y = np.meshgrid(np.linspace(0, 1, 11), np.linspace(0, 1, 11), indexing="ij")
    corner = (np.arange(10)[:, None] * 11 + np.arange(10)).ravel()
    lower = np.stack([corner, corner + 11, corner + 12], axis=1)
    upper = np.stack([corner, corner + 12, corner + 1], axis=1)
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(121)], axis=1)
    faces = np.concatenate([lower, upper])
    return vertices, faces


def _spread(number: int, depth: float) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(0.3, 0.7, (number, 2)), np.full(number, -depth)])


def _ask(board, points: np.ndarray, origins: np.ndarray, agreeing: int = 0) -> np.ndarray:
    vertices, faces = board
    origins = np.broadcast_to(origins, points.shape)
    return find_crossed_vertices(vertices, faces, points, origins, np.full(121, agreeing), MARGIN)


def test_rays_that_end_behind_a_surface_show_that_it_is_gone(board):
    is_passed = _ask(board, _spread(2000, 0.2), ABOVE)
    middle = (np.abs(board[0][:, :2] - 0.5) < 0.15).all(axis=1)
    assert is_passed[middle].all()
    assert not is_passed[(np.abs(board[0][:, :2] - 0.5) > 0.3).any(axis=1)].any()


def test_rays_that_end_before_or_within_the_noise_show_nothing(board):
    for depth in (-0.5, 0.0, 0.5 * MARGIN):
        assert not _ask(board, _spread(2000, depth), ABOVE).any()


def test_a_grazing_ray_shows_nothing(board):
    points = _spread(2000, 0.5 * MARGIN)
    assert not _ask(board, points, np.array([-50.0, 0.5, 0.5])).any()


def test_a_few_rays_against_many_readings_are_not_believed(board):
    assert not _ask(board, _spread(2, 0.2), ABOVE).any()
    assert not _ask(board, _spread(200, 0.2), ABOVE, agreeing=1000).any()


def test_both_sides_of_a_box_are_passed():
    corners = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    rng = np.random.default_rng(1)
    points = np.column_stack([np.full(200, 3.0), rng.uniform(0.05, 0.95, (200, 2))])
    origins = points - np.array([5, 0, 0])
    nothing = np.zeros(8)
    assert find_crossed_vertices(corners, faces, points, origins, nothing, MARGIN).all()


def test_rings_of_neighbors_and_what_they_lead_to(board):
    is_marked, is_allowed = np.zeros((2, 121), dtype=bool)
    is_marked[0], is_allowed[[11, 22, 33, 120]] = True, True
    assert [widen(board[1], is_marked, rings).sum() for rings in range(3)] == [1, 4, 9]
    assert np.flatnonzero(spread(board[1], is_marked, is_allowed)).tolist() == [0, 11, 22, 33]
    assert is_marked.sum() == 1


def test_parts_are_numbered(board):
    is_marked = np.zeros(121, dtype=bool)
    is_marked[[0, 1, 2, 60, 61, 120]] = True
    part = number_parts(board[1], is_marked)
    assert (part[~is_marked] == -1).all()
    assert part[0] == part[1] == part[2]
    assert part[60] == part[61]
    assert len({part[0], part[60], part[120]}) == 3
