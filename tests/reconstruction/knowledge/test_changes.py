"""What new readings say about a known surface."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from shapes import make_floor
from shapes import read_floor as read

from reconstruction._src.knowledge.changes import detect_changes, find_crowded

SPACING = 0.1


@pytest.fixture(scope="module")
def sheet() -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet 2 m x 2 m: (vertices, faces)."""
    return make_floor()


def test_readings_of_the_same_surface_change_nothing(sheet):
    for number in (500, 8000):
        change = detect_changes(*sheet, read(8000), read(number, seed=1), SPACING)
        assert not change.is_moved.any()
        assert not change.is_gone.any()


def test_what_beams_that_met_nothing_went_through_is_gone(sheet):
    begins = np.stack(np.meshgrid(np.linspace(0.8, 1.2, 20), np.linspace(0.8, 1.2, 20), [-0.3]), axis=-1)
    begins = begins.reshape(-1, 3)
    rising, short = (np.stack([begins, begins + np.array([0.0, 0.0, rise])], axis=1) for rise in (1.0, 0.29))
    new = read(8000, seed=1)
    known = new[(np.abs(new[:, :2] - 1) > 0.3).any(axis=1)]
    inside = (np.abs(sheet[0][:, :2] - 1) < 0.15).all(axis=1)
    known = known[known[:, 0] < 1.2]  # not all around it, or it would be gone without rays
    gone, stays = (
        detect_changes(*sheet, read(8000), known[:400], SPACING, None, rays).is_gone
        for rays in (rising, short)
    )
    assert gone[inside].all()
    assert not gone[(np.abs(sheet[0][:, :2] - 1) > 0.4).any(axis=1)].any()
    assert not stays.any()


def test_two_stray_readings_are_not_believed(sheet):
    new = np.concatenate([read(8000, seed=1), [[1, 1, 0.5], [1.02, 1, 0.5]]])
    assert not detect_changes(*sheet, read(8000), new, SPACING).is_moved.any()


@pytest.mark.parametrize(("apart", "is_moved"), [(0.26, True), (0.36, False)])
def test_pairs_of_readings_within_three_spacings_are_believed_together(sheet, apart, is_moved):
    new = read(4000, seed=1) * [1, 1, 0]
    new = new[(np.abs(new[:, :2] - [0.85, 1]) > [0.3, 0.1]).any(axis=1)]
    pairs = [[0.85 + side * apart / 2, y, 0.05] for side in (-1, 1) for y in (0.995, 1.005)]
    change = detect_changes(*sheet, read(8000), np.concatenate([new, pairs]), SPACING)
    assert change.is_moved.sum() == 2 * is_moved


def test_readings_are_crowded_by_their_vertex_or_by_their_neighbors():
    points = np.array([[0, 0, 0], [9, 0, 0], [18, 0, 0], [30, 0, 0], [30.1, 0, 0], [30.2, 0, 0], [50, 0, 0]])
    winners = np.array([1, 1, 1, 2, 2, 3, 4])
    assert find_crowded(winners, points, 1.0, 3).tolist() == [True] * 6 + [False]
    assert not find_crowded(winners[:2], points[:2], 1.0, 3).any()


def test_each_reading_has_its_distance_and_its_vertex(sheet):
    new = read(3000, seed=1)
    change = detect_changes(*sheet, read(8000), new, SPACING)
    assert np.array_equal(change.compared, np.arange(3000))
    inside = ((new[:, :2] > 0) & (new[:, :2] < 2)).all(axis=1)
    assert change.distance[inside] == pytest.approx(np.abs(new[inside, 2]), abs=1e-9)
    assert np.linalg.norm(sheet[0][change.winners] - new, axis=1) == pytest.approx(
        cKDTree(sheet[0]).query(new)[0]
    )
    # Noise of 3 mm is 2.4 mm in the mean; four times that.
    assert change.tolerance == pytest.approx(4 * 0.003 * np.sqrt(2 / np.pi), rel=0.1)
    assert change.is_read.all()
    assert change.is_moved.dtype == change.is_strong.dtype == change.is_gone.dtype == bool


def raise_middle(points: np.ndarray, height: float, share: float = 1.0, seed: int = 3) -> np.ndarray:
    """Put some share of the points within 0.3 m of the middle of the sheet at a height."""
    raised = points.copy()
    is_raised = (np.abs(points[:, :2] - 1) < 0.3).all(axis=1)
    raised[is_raised & (np.random.default_rng(seed).random(len(points)) < share), 2] = height
    return raised


def test_what_has_moved_a_little_is_not_believed_by_few_readings_alone(sheet):
    """A little: by more than the tolerance, 9.6 mm, and less than one and a half times that."""
    old, new = read(8000), read(8000, seed=1)
    inside = (np.abs(sheet[0][:, :2] - 1) < 0.25).all(axis=1)
    for height, is_strong in ((0.011, False), (0.05, True), (-0.05, True)):
        change = detect_changes(*sheet, old, raise_middle(new, height), SPACING)
        assert change.is_moved[inside].mean() > 0.9
        assert (change.is_strong[inside].mean() > 0.9) == is_strong
        outside = (np.abs(sheet[0][:, :2] - 1) > 0.4).any(axis=1)
        assert not (change.is_moved | change.is_strong)[outside].any()


def test_readings_just_beyond_the_rim_say_nothing_and_far_ones_do(sheet):
    new = read(8000, seed=1)
    for beyond, is_moved in ((0.05, False), (0.3, True)):
        more = np.column_stack([np.full(200, 2 + beyond), np.linspace(0, 2, 200), np.zeros(200)])
        change = detect_changes(*sheet, read(8000), np.concatenate([new, more]), SPACING)
        rim = sheet[0][:, 0] > 1.99
        assert change.is_moved[rim].any() == is_moved
        assert not change.is_moved[~rim].any()


@pytest.mark.parametrize(
    ("before", "now", "least", "most"),
    [
        (0.2, 0.2, 0.0, 0.02),
        (0.0, 0.3, 0.4, 0.65),
        (0.2, 0.6, 0.25, 0.45),
        (0.2, 1.0, 0.75, 0.9),
        (0.6, 1.0, 0.02, 0.15),
    ],
)
def test_what_disagreed_before_must_disagree_clearly_more_often(sheet, before, now, least, most):
    """A coarse mesh cuts a corner: some readings near it were off before, too. A vertex has nine new readings."""
    inside = (np.abs(sheet[0][:, :2] - 1) < 0.25).all(axis=1)
    moved = []
    for seed in range(4):
        old = raise_middle(read(8000, seed=10 + seed), 0.05, before, seed=30 + seed)
        new = raise_middle(read(4000, seed=20 + seed), 0.05, now, seed=40 + seed)
        moved.append(detect_changes(*sheet, old, new, SPACING).is_moved[inside].mean())
    assert least <= np.mean(moved) <= most


def test_nothing_depends_on_where_the_world_is(sheet):
    """The same sheet as a wall far from the origin."""

    def stand_up(points):
        return points @ np.array([[0.6, 0.8, 0], [0, 0, 1], [0.8, -0.6, 0]]) + [30.0, -20.0, 5.0]

    old, new = read(8000), raise_middle(read(4000, seed=1), 0.05)
    new = new[np.linalg.norm(new[:, :2] - [1.5, 0.5], axis=1) > 0.25]
    here = detect_changes(*sheet, old, new, SPACING)
    there = detect_changes(stand_up(sheet[0]), sheet[1], stand_up(old), stand_up(new), SPACING)
    assert here.is_moved.any()
    assert here.is_gone.any()
    for name in ("winners", "is_moved", "is_strong", "is_gone", "is_read"):
        assert np.array_equal(getattr(here, name), getattr(there, name)), name
    for name in ("distance", "tolerance"):
        assert getattr(here, name) == pytest.approx(getattr(there, name), abs=1e-6), name


@pytest.mark.parametrize(("side", "is_believed"), [(0.25, True), (0.35, False)])
def test_three_readings_within_three_spacings_are_strong_together(sheet, side, is_believed):
    new = read(3000, seed=1)
    corners = side * np.array([[0, 0], [1, 0], [0.5, np.sqrt(0.75)]])
    stray = np.column_stack([0.72 + corners, np.full(3, 0.06)])
    for some in (stray, stray[:2]):
        change = detect_changes(*sheet, read(8000), np.concatenate([new, some]), SPACING)
        assert not change.is_moved.any()
        assert change.is_strong.any() == (is_believed and len(some) == 3)
