"""Rings of neighbors and connected parts of marked vertices."""

import numpy as np

from reconstruction._src.knowledge.changes.free_space import number_parts, widen

SIDE = 6


def _make_sheet() -> np.ndarray:
    index = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])


def test_rings_of_neighbors():
    is_marked = np.zeros(49, dtype=bool)
    is_marked[0] = True
    assert [widen(_make_sheet(), is_marked, rings).sum() for rings in range(3)] == [1, 4, 9]
    assert is_marked.sum() == 1


def test_parts_are_numbered():
    is_marked = np.zeros(49, dtype=bool)
    is_marked[[0, 1, 2, 24, 25, 48]] = True
    part = number_parts(_make_sheet(), is_marked)
    assert (part[~is_marked] == -1).all()
    assert part[0] == part[1] == part[2]
    assert part[24] == part[25]
    assert len({part[0], part[24], part[48]}) == 3
    assert (number_parts(_make_sheet(), np.zeros(49, dtype=bool)) == -1).all()
