"""Topology learning, manifold repair and hole patching on cases known by hand."""

import numpy as np
import pytest
from constants import with_constants
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import (
    find_excess,
    find_hinges,
    find_loops,
    find_minor_fans,
    find_suspects,
    group_sides,
    make_manifold,
    make_winding,
)
from reconstruction._src.networks.gsrm import hole_patching
from reconstruction._src.networks.gsrm.hole_patching import close_tips, patch_holes
from reconstruction._src.networks.gsrm.support import Support
from reconstruction._src.networks.gsrm.topology import join_components, learn_faces
from reconstruction._src.surfaces.quality import count_topology

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1.2, 0], [0, 1, 0]])


def _make_grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a slightly sheared lattice of units and its Delaunay faces."""
    x, y = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    units = np.stack([x + 0.2 * y, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(float)
    index = np.arange(size * size).reshape(size, size)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    return units, np.concatenate([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)])


def _make_samples(size: int, per_side: int = 8) -> np.ndarray:
    x, y = np.meshgrid(*2 * [np.linspace(0, size - 1, per_side * (size - 1) + 1)], indexing="ij")
    return np.stack([x + 0.2 * y, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)


def _support(samples: np.ndarray, spacing: float) -> Support:
    return Support(cKDTree(samples), np.full(len(samples), spacing))


def test_learns_the_delaunay_faces_of_a_lattice() -> None:
    units, faces = _make_grid(6)
    samples = _make_samples(6)
    winners = cKDTree(units).query(samples, k=3)[1]
    learnt = learn_faces(units, winners, _support(samples, 0.125))
    assert {frozenset(face) for face in learnt.tolist()} == {frozenset(face) for face in faces.tolist()}


def test_a_third_face_at_an_edge_goes() -> None:
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    assert find_excess(group_sides(faces, 5), np.array([3.0, 1.0, 2.0])).tolist() == [1]


def test_a_smaller_fan_goes() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5]])
    sides = group_sides(faces, 6)
    is_suspect = find_suspects(faces, sides, 6)
    assert np.flatnonzero(is_suspect).tolist() == [0]
    assert find_minor_fans(faces, find_hinges(faces, sides), np.ones(3), is_suspect).tolist() == [2]


def test_two_closed_fans_at_one_vertex_are_parted() -> None:
    ring = [1, 2, 3, 4]
    upper = [[0, a, b] for a, b in zip(ring, [2, 3, 4, 1], strict=True)]
    lower = [[0, a + 4, b + 4] for a, b in zip(ring[:3], [2, 3, 1], strict=True)]
    angle = np.arange(4) * np.pi / 2
    top = np.stack([np.cos(angle), np.sin(angle), np.ones(4)], axis=1)
    units = np.concatenate([[[0, 0, 0]], top, -top[:3]])
    kept = make_manifold(units, np.array(upper + lower), np.ones(7))
    assert sorted(map(sorted, kept.tolist())) == sorted(map(sorted, upper))


def test_a_moebius_band_is_cut() -> None:
    count = 24
    turn = np.arange(count) * 2 * np.pi / count
    across = np.stack([np.cos(turn / 2) * np.cos(turn), np.cos(turn / 2) * np.sin(turn), np.sin(turn / 2)], 1)
    middle = 3 * np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)
    units = np.concatenate([middle + across / 2, middle - across / 2])
    i = np.arange(count)
    j = (i + 1) % count
    left, right = np.where(j == 0, count, j), np.where(j == 0, 0, j + count)
    faces = np.concatenate([np.stack([i, left, i + count], 1), np.stack([left, right, i + count], 1)])
    assert count_topology(make_winding(units, faces), len(units)).miswound_edges > 0
    kept = make_manifold(units, faces, np.ones(len(faces)))
    assert count_topology(kept, len(units)).is_manifold
    assert len(faces) - 3 <= len(kept) < len(faces)


def test_winding_becomes_alike_and_keeps_all_faces() -> None:
    units, faces = _make_grid(5)
    mixed = faces.copy()
    mixed[::3] = mixed[::3, ::-1]
    wound = make_winding(units, mixed)
    assert count_topology(wound, len(units)).miswound_edges == 0
    assert {frozenset(face) for face in wound.tolist()} == {frozenset(face) for face in faces.tolist()}


@pytest.mark.parametrize("spacing", [0.125, 0.3])
def test_a_gap_is_patched_where_there_are_samples(spacing: float) -> None:
    units, faces = _make_grid(6)
    holed = make_winding(units, faces[(faces != 14).all(axis=1)])
    assert sorted(map(len, find_loops(holed, 36))) == [6, 20]
    patched, obstacles = patch_holes(units, holed, _support(_make_samples(6), spacing))
    assert len(obstacles) == 0
    topology = count_topology(patched, 36)
    assert topology.is_manifold
    assert (topology.boundary_loops, topology.num_faces) == (1, len(faces) - 2)


def test_a_single_face_is_not_closed_to_a_pillow() -> None:
    units = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    patched, _ = patch_holes(units, np.array([[0, 1, 2]]), _support(units, 1.0))
    assert len(patched) == 1


def test_a_long_loop_is_closed_where_there_are_samples_and_the_rim_is_not() -> None:
    units, faces = _make_grid(16)
    row, column = np.divmod(np.arange(256), 16)
    is_gone = (abs(row - 7) <= 2) & (abs(column - 7) <= 2)
    holed = faces[~is_gone[faces].any(axis=1)]
    assert sorted(map(len, find_loops(holed, 256))) == [22, 60]
    samples = _make_samples(16)
    with with_constants(hole_patching, max_hole_edges=21):
        assert len(patch_holes(units, holed, _support(samples, 0.125))[0]) == len(holed)
    closed = close_tips(units, holed, _support(samples, 0.125))
    assert len(closed) == len(holed) + 20
    topology = count_topology(closed, 256)
    assert topology.is_manifold
    assert (topology.euler_number, topology.boundary_loops) == (1, 1)
    sparse = samples[np.linalg.norm(samples - units[7 * 16 + 7], axis=1) > 2]
    assert len(close_tips(units, holed, _support(sparse, 0.125))) == len(holed)


def test_parts_are_joined_across_a_gap_with_samples() -> None:
    units, faces = _make_grid(6)
    column = np.arange(36) // 6
    parted = faces[~((column[faces] == 2).any(axis=1) & (column[faces] == 3).any(axis=1))]
    assert count_topology(parted, 36).components == 2
    joined = join_components(units, parted, _support(_make_samples(6), 0.2))
    assert count_topology(joined, 36) == count_topology(faces, 36)
    samples = _make_samples(6)
    across = samples[:, 0] - 0.2 * samples[:, 1]
    off = samples[(across <= 2) | (across >= 3)]
    assert len(join_components(units, parted, _support(off, 0.1))) == len(parted)
