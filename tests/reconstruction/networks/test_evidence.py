"""What new readings say about a known surface."""

import numpy as np
import pytest

from reconstruction.networks.evidence import (
    find_crowded,
    find_gone,
    find_read,
    find_superseded,
    weigh_evidence,
)
from reconstruction.networks.padding import pad_rows, padded_length

SIDE = 21
SPACING = 0.1


@pytest.fixture(scope="module")
def sheet() -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet 2 m x 2 m: (vertices, faces)."""
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    lower = np.stack([corner, corner + SIDE, corner + SIDE + 1], axis=1)
    upper = np.stack([corner, corner + SIDE + 1, corner + 1], axis=1)
    vertices = SPACING * np.stack([x.ravel(), y.ravel(), np.zeros(SIDE**2)], axis=1)
    return vertices, np.concatenate([lower, upper])


def read(number: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0, 2, (number, 2)), rng.normal(0, 0.003, number)])


def test_readings_of_the_same_surface_change_nothing(sheet):
    for number in (500, 8000):
        evidence = weigh_evidence(*sheet, read(8000), read(number, seed=1), SPACING)
        assert not evidence.is_moved.any()
        assert not evidence.is_gone.any()


def test_a_raised_part_has_moved(sheet):
    new = read(8000, seed=1)
    is_raised = (np.abs(new[:, :2] - 1) < 0.3).all(axis=1)
    new[is_raised, 2] += 0.05
    evidence = weigh_evidence(*sheet, read(8000), new, SPACING)
    inside = (np.abs(sheet[0][:, :2] - 1) < 0.25).all(axis=1)
    outside = (np.abs(sheet[0][:, :2] - 1) > 0.4).any(axis=1)
    assert evidence.is_moved[inside].all()
    assert not evidence.is_moved[outside].any()


def test_two_stray_readings_are_not_believed(sheet):
    new = np.concatenate([read(8000, seed=1), [[1, 1, 0.5], [1.02, 1, 0.5]]])
    assert not weigh_evidence(*sheet, read(8000), new, SPACING).is_moved.any()


def test_a_hole_in_a_whole_scan_is_gone_and_what_was_out_of_sight_is_not(sheet):
    new = read(8000, seed=1)
    in_hole = (np.abs(new[:, :2] - 1) < 0.4).all(axis=1)
    evidence = weigh_evidence(*sheet, read(8000), new[~in_hole], SPACING)
    assert evidence.is_gone[np.linalg.norm(sheet[0] - [1, 1, 0], axis=1) < 0.2].all()
    corner = new[(new[:, :2] < 0.8).all(axis=1)]
    assert not weigh_evidence(*sheet, read(8000), corner, SPACING).is_gone.any()


def test_a_ring_of_readings_shows_that_its_middle_is_gone(sheet):
    vertices, faces = sheet
    new = read(8000, seed=1)
    radius = np.linalg.norm(new[:, :2] - 1, axis=1)
    ring = new[(radius > 0.5) & (radius < 0.9)]
    is_gone = find_gone(vertices, faces, ring, find_read(vertices, ring, SPACING)[0], SPACING)
    from_middle = np.linalg.norm(vertices[:, :2] - 1, axis=1)
    assert is_gone[from_middle < 0.3].all()
    assert not is_gone[from_middle > 1.1].any()


def test_padding_has_few_sizes_and_wastes_little():
    sizes = {padded_length(n) for n in range(64, 4097)}
    assert len(sizes) < 30
    assert all(n <= padded_length(n) <= 1.25 * n + 1 for n in range(64, 4097))
    np.testing.assert_array_equal(pad_rows(np.array([[1, 2]]), 3, 7), [[1, 2], [7, 7], [7, 7]])


def test_of_very_many_readings_as_many_are_compared_as_suffice(sheet):
    few, many = (
        weigh_evidence(*sheet, read(8000), read(number, seed=1), SPACING) for number in (2000, 60_000)
    )
    assert len(few.compared) == 2000
    assert len(many.compared) < 30_000
    assert not many.is_moved.any()
    # Readings a square metre: the sheet has four.
    assert few.density == pytest.approx(2000 / 4, rel=0.3)
    assert many.density == pytest.approx(60_000 / 4, rel=0.3)


def test_readings_are_crowded_by_their_vertex_or_by_their_neighbours():
    points = np.array([[0, 0, 0], [9, 0, 0], [18, 0, 0], [30, 0, 0], [30.1, 0, 0], [30.2, 0, 0], [50, 0, 0]])
    winners = np.array([1, 1, 1, 2, 2, 3, 4])
    assert find_crowded(winners, points, 1.0).tolist() == [True] * 6 + [False]
    assert not find_crowded(winners[:2], points[:2], 1.0).any()


def test_old_points_are_superseded_where_no_new_reading_beside_them_agrees(sheet):
    new = read(8000, seed=1)
    new[new[:, 0] > 1, 2] += 0.2
    evidence = weigh_evidence(*sheet, read(8000), new, SPACING)
    old = read(2000, seed=2)
    old = old[np.abs(old[:, 0] - 1) > 0.1]
    is_superseded = find_superseded(old, new[evidence.compared], evidence)
    assert is_superseded[old[:, 0] > 1].mean() > 0.95
    assert is_superseded[old[:, 0] < 1].mean() < 0.25
    assert len(find_superseded(old[:0], new[evidence.compared], evidence)) == 0
