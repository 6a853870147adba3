"""A surface goes on learning: what new readings contradict changes, the rest stays where it is."""

import numpy as np
import pytest

import reconstruction as rc
from reconstruction._src.surfaces.quality import compute_distances

NOISE = 0.004
METHODS = pytest.mark.parametrize("method", ["gsrm", "gg"])


def make_floor(x: tuple[float, float], y: tuple[float, float], number: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.stack([rng.uniform(*x, number), rng.uniform(*y, number), np.zeros(number)], axis=1)
    return points + rng.normal(size=points.shape) * NOISE


def make_wall(x: float, number: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.stack([np.full(number, x), rng.uniform(-1, 1, number), rng.uniform(0, 0.5, number)], axis=1)
    return points + rng.normal(size=points.shape) * NOISE


def make_box(number: int, seed: int) -> np.ndarray:
    """Readings of a box 0.6 m x 0.6 m x 0.3 m, without its bottom."""
    rng = np.random.default_rng(seed)
    side = np.stack([np.full(number, 0.3), rng.uniform(-0.3, 0.3, number), rng.uniform(0, 0.3, number)], 1)
    top = np.column_stack([rng.uniform(-0.3, 0.3, (2 * number, 2)), np.full(2 * number, 0.3)])
    sides = [side, side * [-1, 1, 1], side[:, [1, 0, 2]], side[:, [1, 0, 2]] * [1, -1, 1]]
    points = np.concatenate([*sides, top])
    return points + rng.normal(size=points.shape) * NOISE


def clear_of_box(points: np.ndarray) -> np.ndarray:
    return points[(np.abs(points[:, :2]) > 0.3).any(axis=1)]


def distance(points: np.ndarray, surface: rc.Reconstruction) -> np.ndarray:
    mesh = surface.mesh
    return compute_distances(points, np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.fixture(scope="module")
def rooms() -> dict[str, rc.Reconstruction]:
    points = np.concatenate([make_floor((-2, 1), (-1, 1), 14000, 1), make_wall(1.0, 2500, 2)])
    return {method: rc.reconstruct(points, method, units=700) for method in ("gsrm", "gg")}


def check_rest(before: rc.Reconstruction, after: rc.Reconstruction, is_far: np.ndarray) -> None:
    """Refuse a drift where nothing changed."""
    drift = distance(np.asarray(before.mesh.vertices)[is_far], after)
    assert np.median(drift) < 0.001
    assert drift.max() < 0.004
    quality = after.quality()
    assert quality.folds + quality.self_intersections == 0


@pytest.mark.slow
@METHODS
def test_readings_that_agree_change_nothing(rooms, method):
    room = rooms[method]
    new = np.concatenate([make_floor((-2, 1), (-1, 1), 1500, 7), make_wall(1.0, 300, 8)])
    again = room.refine(new)
    np.testing.assert_array_equal(again.mesh.vertices, room.mesh.vertices)
    assert again.readings.num_points == room.readings.num_points + len(new)


@pytest.mark.slow
@METHODS
@pytest.mark.parametrize("by", [0.05, 0.2])
def test_a_wall_that_moved_moves_as_in_a_fresh_fit(rooms, method, by):
    room = rooms[method]
    new = np.concatenate([make_wall(1 + by, 1500, 8), make_floor((0.7, 1 + by), (-1, 1), 1500, 9)])
    moved = room.refine(new)
    fresh = rc.reconstruct(moved.points, method, units=700)
    assert distance(new, moved).mean() < 1.15 * distance(new, fresh).mean() + 0.0005
    known = moved.readings.points
    of_old_wall = (np.abs(known[:, 0] - 1.0) < 0.01) & (known[:, 2] > 0.08) & (known[:, 2] < 0.48)
    assert of_old_wall.sum() < 207, "a tenth of the old wall's readings"
    check_rest(room, moved, room.mesh.vertices[:, 0] < 0.5)


@pytest.mark.slow
@METHODS
def test_a_new_part_grows(rooms, method):
    room = rooms[method]
    new = make_floor((-2, 1), (1, 1.6), 4000, 10)
    grown = room.refine(new)
    assert distance(new, grown).mean() < 0.008
    assert grown.mesh.area > 1.12 * room.mesh.area
    assert grown.readings.num_points > 0.99 * (room.readings.num_points + len(new))


@pytest.mark.slow
@METHODS
def test_a_box_comes_and_goes(method):
    surface = rc.reconstruct(make_floor((-1.5, 1.5), (-1, 1), 16_000, 3), method, units=700)
    first = surface
    for turn in range(4):
        new = make_floor((-0.6, 0.6), (-0.6, 0.6), 4000, turn + 20)
        if turn % 2 == 0:
            new = np.concatenate([clear_of_box(new), make_box(800, turn + 40)])
        surface = surface.refine(new, seed=turn, origins=new + np.array([0.0, 0.0, 2.0]))
        if turn % 2 == 0:
            assert distance(new, surface).mean() < 0.012
        else:
            assert surface.mesh.vertices[:, 2].max() < 0.05, "the box is gone"
            assert (surface.readings.points[:, 2] > 0.1).mean() < 0.001
    check_rest(first, surface, np.abs(first.mesh.vertices[:, 0]) > 1.0)
    assert distance(make_floor((-1.5, 1.5), (-1, 1), 4000, 60), surface).mean() < 0.006
    assert 600 < len(surface.mesh.vertices) < 800


@pytest.mark.slow
@METHODS
def test_what_all_around_was_read_again_is_gone_without_rays(method):
    points = np.concatenate([make_box(800, 6), clear_of_box(make_floor((-1, 1), (-1, 1), 12_000, 1))])
    surface = rc.reconstruct(points, method, units=700)
    before = (surface.mesh.vertices[:, 2] > 0.1).sum()
    assert before > 50
    cleared = surface.refine(make_floor((-1, 1), (-1, 1), 6000, 11))
    assert (cleared.mesh.vertices[:, 2] > 0.1).sum() < 0.1 * before


@pytest.mark.slow
@METHODS
def test_equal_seeds_give_equal_surfaces(rooms, method):
    new = make_wall(1.2, 1500, 8)
    first, second = (rooms[method].refine(new, seed=3).mesh for _ in range(2))
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)
