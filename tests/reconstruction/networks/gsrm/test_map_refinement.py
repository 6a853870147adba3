"""A grown map goes on learning: what is contradicted changes, the rest stays put."""

import numpy as np
import pytest

from reconstruction._src.networks.change.refinement import refine as refine_network
from reconstruction._src.networks.gsrm.gsrm import GSRMConfig, State, train
from reconstruction._src.networks.gsrm.refinement import Learner
from reconstruction._src.networks.som.compilation import keep_compiled_programs
from reconstruction._src.surfaces.quality import count_topology, find_distances

keep_compiled_programs()
NOISE = 0.004
CONFIG = GSRMConfig(units=700)


def refine(
    state: State,
    points: np.ndarray,
    new_points: np.ndarray,
    config: GSRMConfig,
    seed: int = 0,
    origins: np.ndarray | None = None,
) -> tuple[State, np.ndarray]:
    return refine_network(Learner(state, config), points, new_points, seed, origins=origins)


def _floor(x: tuple[float, float], y: tuple[float, float], number: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.stack([rng.uniform(*x, number), rng.uniform(*y, number), np.zeros(number)], axis=1)
    return points + rng.normal(size=points.shape) * NOISE


def _wall(x: float, number: int, seed: int = 2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.stack([np.full(number, x), rng.uniform(-1, 1, number), rng.uniform(0, 0.5, number)], axis=1)
    return points + rng.normal(size=points.shape) * NOISE


@pytest.fixture(scope="module")
def room() -> tuple[State, np.ndarray]:
    return _map_room(seed=0)


def _map_room(seed: int) -> tuple[State, np.ndarray]:
    points = np.concatenate([_floor((-2, 1), (-1, 1), 14000), _wall(1.0, 2500)])
    return train(points, CONFIG, seed), points


def _check(state: State) -> None:
    topology = count_topology(state.faces, len(state.units))
    assert topology.is_manifold
    assert topology.unused_vertices == 0
    assert topology.components == 1


def test_readings_that_agree_change_nothing(room: tuple[State, np.ndarray]) -> None:
    state, points = room
    new = np.concatenate([_floor((-2, 1), (-1, 1), 1500, 7), _wall(1.0, 300, 8)])
    again, known = refine(state, points, new, CONFIG)
    np.testing.assert_array_equal(again.units, state.units)
    assert len(known) == len(points) + len(new)


def test_a_wall_that_moved_moves(room: tuple[State, np.ndarray]) -> None:
    state, points = room
    new = np.concatenate([_wall(1.2, 1500, 8), _floor((0.5, 1.2), (-1, 1), 1500, 9)])
    moved, known = refine(state, points, new, CONFIG)
    _check(moved)
    assert find_distances(new, moved.units, moved.faces).mean() < 0.006
    others = [refine(*_map_room(seed), new, CONFIG)[0] for seed in (1, 2)]
    high = np.concatenate([each.units[each.units[:, 2] > 0.1] for each in (moved, *others)])
    assert (np.abs(high[:, 0] - 1.2) < 0.03).mean() > 0.95  # one map has 75 such units: three say more
    assert len(known) < len(points) + len(new)
    far = points[points[:, 0] < 0]
    before, after = (find_distances(far, s.units, s.faces) for s in (state, moved))
    np.testing.assert_allclose(after, before, atol=0.002)


def test_a_wall_that_moved_by_less_than_an_edge_keeps_its_faces(room: tuple[State, np.ndarray]) -> None:
    state, points = room
    new = np.concatenate([_wall(1.05, 1500, 8), _floor((0.7, 1.05), (-1, 1), 1500, 9)])
    moved, known = refine(state, points, new, CONFIG)
    _check(moved)
    assert moved.units.shape == state.units.shape
    assert len(moved.faces) == len(state.faces)
    assert find_distances(new, moved.units, moved.faces).mean() < 0.006
    is_far = state.units[:, 0] < 0.7
    assert {tuple(unit) for unit in state.units[is_far]} <= {tuple(unit) for unit in moved.units}
    # Of the 2,073 readings of the old wall a tenth at most is left in what the map knows (0 to 85 seen, six seeds).
    assert ((np.abs(known[:, 0] - 1.0) < 0.01) & (known[:, 2] > 0.08)).sum() < 207


def test_a_wall_that_goes_out_and_back_leaves_a_sound_map(room: tuple[State, np.ndarray]) -> None:
    state, known = room
    for turn in range(8):
        x = (1.05, 1.0)[turn % 2]
        new = np.concatenate([_wall(x, 1500, turn + 30), _floor((0.7, x), (-1, 1), 1500, turn + 50)])
        state, known = refine(state, known, new, CONFIG, turn)
        _check(state)
        topology = count_topology(state.faces, len(state.units))
        assert (topology.euler_number, topology.boundary_loops) == (1, 1)
    assert find_distances(new, state.units, state.faces).mean() < 0.007


def test_a_whole_new_scan_of_a_coarse_map_moves_nothing(room: tuple[State, np.ndarray]) -> None:
    points = room[1]
    config = GSRMConfig(units=120)
    state = train(points, config, 0)
    new = np.concatenate([_floor((-2, 1), (-1, 1), 14000, 21), _wall(1.0, 2500, 22)])
    again, _ = refine(state, points, new, config)
    np.testing.assert_array_equal(again.units, state.units)


def test_a_new_part_grows(room: tuple[State, np.ndarray]) -> None:
    state, points = room
    new = _floor((-2, 1), (1, 1.6), 4000, 10)
    grown, known = refine(state, points, new, CONFIG)
    _check(grown)
    assert 1.1 < len(grown.units) / len(state.units) < 1.45
    assert find_distances(new, grown.units, grown.faces).mean() < 0.006
    assert len(known) > 0.99 * (len(points) + len(new))


def test_a_part_that_is_no_longer_there_goes() -> None:
    floor = _floor((-1, 1), (-1, 1), 12000)
    on_box = (np.abs(floor[:, :2]) < 0.3).all(axis=1)
    floor[on_box, 2] += 0.3
    rng = np.random.default_rng(3)
    turns = [np.stack([np.full(800, 0.3), rng.uniform(-0.3, 0.3, 800), rng.uniform(0, 0.3, 800)], 1)]
    turns += [turns[0] * [-1, 1, 1], turns[0][:, [1, 0, 2]], turns[0][:, [1, 0, 2]] * [1, -1, 1]]
    points = np.concatenate([floor, *turns])
    state = train(points, CONFIG, 0)
    assert (state.units[:, 2] > 0.1).sum() > 50
    new = _floor((-1, 1), (-1, 1), 6000, 11)
    cleared, _ = refine(state, points, new, CONFIG)
    _check(cleared)
    assert (cleared.units[:, 2] > 0.1).sum() <= 2
    assert find_distances(new, cleared.units, cleared.faces).mean() < 0.006


def _box(number: int, seed: int) -> np.ndarray:
    """Readings of a box 0.6 m x 0.6 m x 0.3 m, without its bottom."""
    rng = np.random.default_rng(seed)
    side = np.stack([np.full(number, 0.3), rng.uniform(-0.3, 0.3, number), rng.uniform(0, 0.3, number)], 1)
    top = np.column_stack([rng.uniform(-0.3, 0.3, (2 * number, 2)), np.full(2 * number, 0.3)])
    sides = [side, side * [-1, 1, 1], side[:, [1, 0, 2]], side[:, [1, 0, 2]] * [1, -1, 1]]
    points = np.concatenate([*sides, top])
    return points + rng.normal(size=points.shape) * NOISE


def _clear_of_box(points: np.ndarray) -> np.ndarray:
    return points[(np.abs(points[:, :2]) > 0.3).any(axis=1)]


def test_a_new_box_grows_on_the_floor_and_the_rest_stays_bit_for_bit() -> None:
    points = _floor((-1.5, 1.5), (-1, 1), 16_000)
    state = train(points, CONFIG, 0)
    new = np.concatenate([_box(800, 4), _clear_of_box(_floor((-0.6, 0.6), (-0.6, 0.6), 3000, 5))])
    grown, _ = refine(state, points, new, CONFIG)
    _check(grown)
    assert count_topology(grown.faces, len(grown.units)).boundary_loops == 1
    assert find_distances(new, grown.units, grown.faces).mean() < 0.008
    far = state.units[np.abs(state.units[:, 0]) > 0.6]
    kept = {tuple(unit) for unit in grown.units}
    assert all(tuple(unit) in kept for unit in far)


def test_rays_through_a_box_take_it_away() -> None:
    points = np.concatenate([_box(800, 6), _clear_of_box(_floor((-1.5, 1.5), (-1, 1), 16_000))])
    state = train(points, CONFIG, 0)
    new = _floor((-0.6, 0.6), (-0.6, 0.6), 4000, 7)
    origins = (
        new + np.array([0.0, 0.0, 2.0]) + 1.5 * np.random.default_rng(8).normal(size=(4000, 3)) * [1, 1, 0]
    )
    cleared, known = refine(state, points, new, CONFIG, origins=origins)
    _check(cleared)
    assert cleared.units[:, 2].max() < 0.05
    assert (known[:, 2] > 0.1).mean() < 0.001
    topology = count_topology(cleared.faces, len(cleared.units))
    assert (topology.euler_number, topology.boundary_loops) == (1, 1)


@pytest.mark.slow
def test_ten_times_in_a_row_do_no_harm() -> None:
    known = _floor((-1.5, 1.5), (-1, 1), 16_000)
    state = train(known, CONFIG, 0)
    for turn in range(10):
        new = _floor((-0.6, 0.6), (-0.6, 0.6), 4000, turn + 20)
        if turn % 2 == 0:
            new = np.concatenate([_clear_of_box(new), _box(800, turn + 40)])
        origins = new + np.array([0.0, 0.0, 2.0])
        state, known = refine(state, known, new, CONFIG, turn, origins=origins)
        _check(state)
    level = _floor((-1.5, 1.5), (-1, 1), 4000, 60)
    assert find_distances(level, state.units, state.faces).mean() < 0.006
    assert 600 < len(state.units) < 800
    assert count_topology(state.faces, len(state.units)).euler_number == 1


def test_equal_seeds_give_equal_maps(room: tuple[State, np.ndarray]) -> None:
    state, points = room
    new = _wall(1.2, 1500, 8)
    first, second = (refine(state, points, new, CONFIG, 3)[0] for _ in range(2))
    np.testing.assert_array_equal(first.units, second.units)
    np.testing.assert_array_equal(first.faces, second.faces)
