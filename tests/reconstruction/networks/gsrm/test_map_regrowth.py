"""Small gaps are closed, and shreds of new faces do not stay."""

import numpy as np

from reconstruction._src.networks.gsrm.regrowth import close_triangles, drop_islands
from reconstruction._src.surfaces.quality import count_topology

MIN_ISLAND = 24


def _make_sheet(side: int, first: int = 0) -> np.ndarray:
    """Two triangles for each of `side` x `side` cells, units numbered from `first` on."""
    index = first + np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])


def test_a_loop_of_three_edges_at_a_new_unit_is_closed():
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    below = np.column_stack([ring[:, ::-1], np.full(4, 4)])
    octahedron = np.concatenate([below, np.column_stack([ring, np.full(4, 5)])])
    closed = close_triangles(octahedron[:-1], 6, num_kept=5)
    assert (closed.shape, count_topology(closed, 6).boundary_edges) == ((8, 3), 0)
    assert len(close_triangles(octahedron[:-1], 6, num_kept=6)) == 7
    assert len(close_triangles(octahedron[:1], 6, num_kept=0)) == 1


def test_a_shred_of_new_faces_goes_and_a_new_surface_stays():
    kept, shred, surface = _make_sheet(2), _make_sheet(2, first=9), _make_sheet(4, first=18)
    assert len(shred) < MIN_ISLAND <= len(surface)
    faces = np.concatenate([kept, shred, surface])
    np.testing.assert_array_equal(
        drop_islands(faces, 43, num_kept=9, min_island=MIN_ISLAND), np.concatenate([kept, surface])
    )
    # What has a kept unit stays however small it is.
    np.testing.assert_array_equal(drop_islands(faces, 43, num_kept=10, min_island=MIN_ISLAND), faces)
    assert len(drop_islands(faces[:0], 43, num_kept=9, min_island=MIN_ISLAND)) == 0
