"""A grown grid goes on learning where readings contradict it, and nowhere else."""

import numpy as np
import pytest

from reconstruction._src.networks.change.refinement import refine as refine_network
from reconstruction._src.networks.growing_grid.cover import open_pinches
from reconstruction._src.networks.growing_grid.growing_grid import GrowingGridConfig, State, train
from reconstruction._src.networks.growing_grid.marks import close_gaps
from reconstruction._src.networks.growing_grid.refinement import Learner
from reconstruction._src.networks.growing_grid.relearning import span_gone
from reconstruction._src.networks.som.compilation import keep_compiled_programs
from reconstruction._src.surfaces.quality import count_topology, find_distances

keep_compiled_programs()
CONFIG = GrowingGridConfig(units=600)
NOISE = 0.003


def refine(
    state: State,
    points: np.ndarray,
    new_points: np.ndarray,
    config: GrowingGridConfig,
    seed: int = 0,
    origins: np.ndarray | None = None,
) -> tuple[State, np.ndarray]:
    return refine_network(Learner(state, config), points, new_points, seed, origins=origins)


def _ground(number: int, seed: int, hump: float = 0.0) -> np.ndarray:
    """Level ground 3 m x 2 m, with a round hump of some height in the middle of its right half."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1.5, 1.5, number), rng.uniform(-1, 1, number)
    z = hump * np.exp(-((x - 0.7) ** 2 + y**2) / 0.05)
    return np.stack([x, y, z], axis=1) + rng.normal(0, NOISE, (number, 3))


def _near_hump(points: np.ndarray) -> np.ndarray:
    return points[np.hypot(points[:, 0] - 0.7, points[:, 1]) < 0.7]


@pytest.fixture(scope="module")
def ground() -> tuple[State, np.ndarray]:
    points = _ground(16_000, 1)
    return train(points, CONFIG, 0), points


def test_a_hump_rises_and_the_rest_stays_bit_for_bit(ground):
    state, points = ground
    new = _near_hump(_ground(16_000, 2, hump=0.2))
    changed, known = refine(state, points, new, CONFIG)
    assert find_distances(new, changed.vertices, changed.faces).mean() < 0.005
    is_far = state.units[..., 0] < -0.3
    kept = {tuple(unit) for unit in changed.vertices}
    share = np.mean([tuple(unit) in kept for unit in state.units[is_far]])
    assert share > 0.99
    far = points[points[:, 0] < -0.3]
    before, after = (find_distances(far, s.vertices, s.faces) for s in (state, changed))
    np.testing.assert_allclose(after, before, atol=0.001)
    topology = count_topology(changed.faces, len(changed.vertices))
    assert (topology.euler_number, topology.boundary_loops, topology.is_manifold) == (1, 1, True)
    assert len(known) < len(points) + len(new)


def test_what_is_read_anew_but_has_not_changed_stays_bit_for_bit(ground):
    state, points = ground
    new = _near_hump(_ground(24_000, 2, hump=0.2))
    changed, known = refine(state, points, new, CONFIG)
    is_far = np.hypot(state.units[..., 0] - 0.7, state.units[..., 1]) > 0.65
    if changed.units.shape == state.units.shape:
        np.testing.assert_array_equal(changed.units[is_far], state.units[is_far])
    far = points[np.hypot(points[:, 0] - 0.7, points[:, 1]) > 0.65]
    before, after = (find_distances(far, s.vertices, s.faces) for s in (state, changed))
    assert np.abs(before - after).max() < 0.002
    # Readings of the level ground from before the hump are forgotten, and those about it are not.
    radius = np.hypot(known[:, 0] - 0.7, known[:, 1])
    assert (np.abs(known[radius < 0.15, 2]) < 0.03).sum() < 5
    assert (radius > 0.7).sum() == (np.hypot(points[:, 0] - 0.7, points[:, 1]) > 0.7).sum()


def test_gaps_between_moved_units_are_closed_up_to_the_rim():
    is_moved = np.zeros((8, 12), dtype=bool)
    is_moved[-1, [0, 1, 4, 6, 10]] = True
    closed = close_gaps(is_moved, 2)
    assert closed[-1, :11].all()
    assert not closed[:-2].any()
    assert not close_gaps(np.zeros((8, 12), dtype=bool), 2).any()


def test_rays_through_a_hump_level_it(ground):
    points = _ground(16_000, 3, hump=0.3)
    state = train(points, CONFIG, 0)
    new = _near_hump(_ground(16_000, 4))
    changed, _ = refine(state, points, new, CONFIG, origins=new + np.array([0.0, 0.0, 2.0]))
    used = changed.vertices[np.unique(changed.faces)]
    assert used[:, 2].max() < 0.03
    assert find_distances(new, changed.vertices, changed.faces).mean() < 0.005


def test_six_times_in_a_row_do_no_harm(ground):
    state, known = ground
    for turn in range(6):
        new = _near_hump(_ground(16_000, 10 + turn, hump=0.1 * (turn % 2 == 0)))
        state, known = refine(state, known, new, CONFIG, seed=turn)
    level = _ground(8000, 30)
    assert find_distances(level, state.vertices, state.faces).mean() < 0.005
    topology = count_topology(state.faces, len(state.vertices))
    assert (topology.euler_number, topology.boundary_loops, topology.is_manifold) == (1, 1, True)


def test_equal_seeds_give_equal_grids(ground):
    state, points = ground
    new = _near_hump(_ground(16_000, 2, hump=0.2))
    first, second = (refine(state, points, new, CONFIG, 3)[0] for _ in range(2))
    assert first.units.tobytes() == second.units.tobytes()
    assert first.has_face.tobytes() == second.has_face.tobytes()


def test_cells_that_touch_at_a_corner_are_opened():
    cells = np.array([[True, False], [False, True]])
    assert open_pinches(cells).sum() == 1


def test_gone_units_become_a_membrane_between_the_others():
    x, y = np.meshgrid(np.arange(7.0), np.arange(6.0), indexing="ij")
    plane = np.stack([x, y, 0.5 * x - 0.2 * y], axis=2)
    is_gone = np.zeros((7, 6), dtype=bool)
    is_gone[2:5, 1:4] = True
    bumpy = np.where(is_gone[..., None], plane + np.array([0, 0, 3.0]), plane)
    np.testing.assert_allclose(span_gone(bumpy, is_gone), plane, atol=1e-12)
    np.testing.assert_array_equal(span_gone(bumpy, is_gone)[~is_gone], plane[~is_gone])


def test_units_that_do_not_move_stay_to_the_bit_where_lines_are_inserted(ground):
    state, points = ground
    beyond = _ground(16_000, 5)
    beyond = beyond[beyond[:, 0] > 0.4] + [0.9, 0.0, 0.0]
    refined, _ = refine(state, points, beyond, CONFIG)
    assert refined.units.size > state.units.size
    old, new = state.units.reshape(-1, 3), {unit.tobytes() for unit in refined.units.reshape(-1, 3)}
    assert all(unit.tobytes() in new for unit in old[old[:, 0] < 0.8])
