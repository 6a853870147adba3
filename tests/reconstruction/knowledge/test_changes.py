"""What new readings, those that are missing, and rays say about a known surface."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from shapes import make_floor
from shapes import read_floor as read

from reconstruction._src.geometry.manifold import spread, widen
from reconstruction._src.knowledge.changes import (
    detect_changes,
    find_crossed_vertices,
    find_crowded,
    find_gone,
    find_read,
    number_parts,
)

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


SIDE = 21


def test_a_hole_in_a_whole_scan_is_gone_and_what_was_out_of_sight_is_not(sheet):
    new = read(8000, seed=1)
    in_hole = (np.abs(new[:, :2] - 1) < 0.4).all(axis=1)
    change = detect_changes(*sheet, read(8000), new[~in_hole], SPACING)
    assert change.is_gone[np.linalg.norm(sheet[0] - [1, 1, 0], axis=1) < 0.2].all()
    corner = new[(new[:, :2] < 0.8).all(axis=1)]
    assert not detect_changes(*sheet, read(8000), corner, SPACING).is_gone.any()


def lay_ring(inner: float, outer: float, missing: float = 0.0) -> np.ndarray:
    """Readings on a ring round the middle of the sheet, but for a sector of some degrees."""
    angle, radius = np.meshgrid(np.radians(np.arange(missing, 360, 3)), np.linspace(inner, outer, 4))
    flat = np.zeros(angle.size)
    return np.column_stack([1 + (radius * np.cos(angle)).ravel(), 1 + (radius * np.sin(angle)).ravel(), flat])


@pytest.mark.parametrize(
    ("readings", "is_surrounded"),
    [
        (lay_ring(0.4, 0.5), True),
        (lay_ring(1.10, 1.15), True),
        (lay_ring(1.22, 1.28), False),
        (lay_ring(0.4, 0.5, missing=70), False),
        (lay_ring(0.05, 0.2), False),
    ],
)
def test_a_patch_is_gone_if_readings_lie_just_beyond_it_on_all_sides(sheet, readings, is_surrounded):
    """A patch of radius 0.3 m; just beyond is within its radius and six times the spacing."""
    vertices, faces = sheet
    patch = np.linalg.norm(vertices - [1, 1, 0], axis=1) < 0.31
    is_read = ~patch
    is_read[vertices[:, 0] < 0.45] = False
    is_gone = find_gone(vertices, faces, readings, is_read, SPACING)
    assert is_gone.dtype == bool
    assert np.array_equal(is_gone, patch if is_surrounded else np.zeros_like(patch))


def test_one_or_two_vertices_without_readings_are_no_hole_and_every_hole_is_looked_at_alone(sheet):
    vertices, faces = sheet
    middle = SIDE * 10 + 10
    is_read = vertices[:, 0] > 0.45
    for unread, is_hole in (([0], False), ([0, 1], False), ([0, 1, SIDE], True)):
        missing = middle + np.array(unread)
        is_gone = find_gone(
            vertices, faces, lay_ring(0.3, 0.4), is_read & ~np.isin(np.arange(SIDE**2), missing), SPACING
        )
        assert np.flatnonzero(is_gone).tolist() == (missing.tolist() if is_hole else [])


def test_a_scan_of_nearly_all_shows_what_is_gone_wherever_it_is(sheet):
    vertices, faces = sheet
    for width, is_whole in ((3, True), (5, False)):
        is_edge = vertices[:, 0] < (width - 0.5) * SPACING
        readings = vertices[~is_edge]
        is_gone = find_gone(vertices, faces, readings, ~is_edge, SPACING)
        assert np.array_equal(is_gone, is_edge if is_whole else np.zeros_like(is_edge))
    loose = np.concatenate([vertices, [[5.0, 5.0, 5.0]]])
    nothing = find_gone(loose, faces, vertices, np.r_[np.ones(SIDE**2, dtype=bool), False], SPACING)
    assert nothing.dtype == bool
    assert not nothing.any(), "a vertex of no face cannot go"


def test_a_vertex_is_read_where_a_reading_is_as_near_as_readings_are_dense():
    """Readings 5 cm apart: a vertex within 7.5 cm and its own spacing of one is read."""
    x, y = np.meshgrid(0.05 * np.arange(21), 0.05 * np.arange(21))
    readings = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    vertices = np.array(
        [[0.5, 0.5, 0.0], [0.5, 0.5, 0.17], [0.5, 0.5, 0.18], [1.17, 1.0, 0.0], [1.18, 1.0, 0.0]]
    )
    is_read = find_read(vertices, readings, SPACING)
    assert is_read.tolist() == [True, True, False, True, False]
    assert is_read.dtype == bool
    few = find_read(vertices, readings[:2], SPACING)
    assert not few.any()


def test_what_rays_pass_through_is_gone(sheet):
    """A floor a meter below the sheet is seen from a meter above its middle."""
    new = read(4000, seed=1)
    under = (np.abs(new[:, :2] - 1) < 0.5).all(axis=1)
    new[under, 2] -= 1.0
    origins = new * [1, 1, 0] + [0, 0, 1.0]
    gone = detect_changes(*sheet, read(8000), new, SPACING, origins).is_gone
    inside = (np.abs(sheet[0][:, :2] - 1) < 0.35).all(axis=1)
    assert gone[inside].all()
    assert not gone[(np.abs(sheet[0][:, :2] - 1) > 0.65).any(axis=1)].any()


MARGIN = 0.01
ABOVE = np.array([0.5, 0.5, 2.0])


@pytest.fixture(scope="module")
def board() -> tuple[np.ndarray, np.ndarray]:
    """A level board of 1 m x 1 m, eleven vertices a side."""
    return make_floor(11, size=1.0)


def spread_points(number: int, depth: float) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(0.3, 0.7, (number, 2)), np.full(number, -depth)])


def find_passed(board, points: np.ndarray, origins: np.ndarray, agreeing: int = 0) -> np.ndarray:
    vertices, faces = board
    origins = np.broadcast_to(origins, points.shape)
    return find_crossed_vertices(vertices, faces, points, origins, np.full(121, agreeing), MARGIN)


def test_rays_that_end_behind_a_surface_show_that_it_is_gone(board):
    is_passed = find_passed(board, spread_points(2000, 0.2), ABOVE)
    middle = (np.abs(board[0][:, :2] - 0.5) < 0.15).all(axis=1)
    assert is_passed[middle].all()
    assert not is_passed[(np.abs(board[0][:, :2] - 0.5) > 0.3).any(axis=1)].any()


def test_rays_that_end_before_or_within_the_noise_show_nothing(board):
    for depth in (-0.5, 0.0, 0.5 * MARGIN):
        assert not find_passed(board, spread_points(2000, depth), ABOVE).any()


def test_a_grazing_ray_shows_nothing(board):
    points = spread_points(2000, 0.5 * MARGIN)
    assert not find_passed(board, points, np.array([-50.0, 0.5, 0.5])).any()


def test_a_few_rays_against_many_readings_are_not_believed(board):
    assert not find_passed(board, spread_points(2, 0.2), ABOVE).any()
    assert not find_passed(board, spread_points(200, 0.2), ABOVE, agreeing=1000).any()


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
