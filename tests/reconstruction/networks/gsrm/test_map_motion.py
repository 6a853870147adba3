"""Units go to where their readings are now, and keep their faces."""

import numpy as np
import pytest

from reconstruction._src.networks.change.detection import Change
from reconstruction._src.networks.gsrm.motion import find_movable, move_units
from reconstruction._src.networks.gsrm.refinement_config import GSRMRefinementConfig
from reconstruction._src.networks.least_squares import FitConfig
from reconstruction._src.networks.som.compilation import keep_compiled_programs

keep_compiled_programs()
SIDE = 12
EDGE = 0.1
CONFIG = GSRMRefinementConfig()
MOVING = (EDGE, CONFIG.motion, FitConfig(), CONFIG.fit_rounds)


@pytest.fixture(scope="module")
def sheet() -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    index = np.arange(SIDE**2).reshape(SIDE, SIDE)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    return EDGE * np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(float), faces


def _raise(units: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which units lie in the middle, and readings there, raised."""
    is_middle = (np.abs(units[:, :2] - units[:, :2].mean(axis=0)) < 0.25).all(axis=1)
    rng = np.random.default_rng(0)
    low, high = units[is_middle].min(axis=0)[:2], units[is_middle].max(axis=0)[:2]
    places = rng.uniform(low - EDGE / 2, high + EDGE / 2, (1500, 2))
    return is_middle, np.column_stack([places, height + rng.normal(0, 0.002, 1500)])


def test_a_raised_part_is_followed_and_the_rest_stays(sheet):
    units, faces = sheet
    is_middle, samples = _raise(units, 0.06)
    moved, joined, has_arrived = move_units(units, faces, is_middle, samples, *MOVING)
    np.testing.assert_array_equal(has_arrived, is_middle)
    np.testing.assert_array_equal(moved[~is_middle], units[~is_middle])
    np.testing.assert_allclose(moved[is_middle, 2], 0.06, atol=0.01)
    assert joined.shape == faces.shape
    again, _, _ = move_units(units, faces, is_middle, samples, *MOVING)
    assert again.tobytes() == moved.tobytes()


def test_what_would_be_drawn_out_stays_as_it_was(sheet):
    units, faces = sheet
    is_middle, samples = _raise(units, 0.6)
    moved, joined, has_arrived = move_units(units, faces, is_middle, samples, *MOVING)
    assert not has_arrived.any()
    np.testing.assert_array_equal(moved, units)
    np.testing.assert_array_equal(joined, faces)
    assert not move_units(units, faces, is_middle, samples[:0], *MOVING)[2].any()


def _make_change(winners: list[int], distance: float, is_moved: np.ndarray, is_gone: np.ndarray) -> Change:
    number = len(winners)
    return Change(
        np.arange(number),
        np.array(winners),
        np.full(number, distance),
        0.01,
        is_moved,
        is_moved,
        is_gone,
        is_moved,
        1000.0,
    )


def test_a_part_far_from_its_readings_or_gone_grows_anew(sheet):
    faces = sheet[1]
    is_doubtful, nothing = np.zeros(SIDE**2, dtype=bool), np.zeros(SIDE**2, dtype=bool)
    is_doubtful[[0, 1, 143]] = True
    near = _make_change([0, 0, 0, 143, 143], 0.05, is_doubtful, nothing)
    np.testing.assert_array_equal(find_movable(faces, is_doubtful, near, EDGE, CONFIG.motion, 3), is_doubtful)
    far = _make_change([0, 0, 0, 143, 143], 0.3, is_doubtful, nothing)
    assert np.flatnonzero(find_movable(faces, is_doubtful, far, EDGE, CONFIG.motion, 3)).tolist() == [143]
    gone = _make_change([0, 0, 0], 0.05, nothing, is_doubtful)
    assert not find_movable(faces, is_doubtful, gone, EDGE, CONFIG.motion, 3).any()


def test_floor_does_not_become_the_lid_of_a_box_as_high_as_an_edge(sheet):
    faces = sheet[1]
    is_below, nothing = np.zeros(SIDE**2, dtype=bool), np.zeros(SIDE**2, dtype=bool)
    is_below[[0, 1]] = True
    for height, is_lifted in ((0.6 * EDGE, True), (EDGE, False)):
        change = _make_change([0, 0, 0, 1, 1, 1], height, is_below, nothing)
        assert find_movable(faces, is_below, change, EDGE, CONFIG.motion, 3).any() == is_lifted
