"""Folded faces are found, and laid flat."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import make_floor

from reconstruction._src.surfaces import unfolding
from reconstruction._src.surfaces.intersections import find_folded_edges, find_intersections
from reconstruction._src.surfaces.unfolding import find_folded, unfold_faces, untangle


def make_lattice(size: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Return a flat square lattice, `[size², 3]` and its faces."""
    return make_floor(size, size - 1.0)


def test_a_flat_lattice_has_no_folds_and_stays():
    vertices, faces = make_lattice()
    assert not find_folded(vertices, faces).any()
    np.testing.assert_array_equal(unfold_faces(vertices, faces)[0], vertices)


@pytest.mark.parametrize("vertex", [24, 3])  # the middle; the rim
def test_a_vertex_beyond_its_neighbors_comes_back(vertex):
    vertices, faces = make_lattice()
    spoiled = vertices.copy()
    spoiled[vertex, :2] += [1.6, 0.3]
    assert find_folded(spoiled, faces).any()
    mended, _ = unfold_faces(spoiled, faces)
    assert not find_folded(mended, faces).any()
    np.testing.assert_allclose(mended[:, 2], 0, atol=1e-12)
    is_far = np.abs(vertices - vertices[vertex]).max(axis=1) > 2.5
    np.testing.assert_array_equal(mended[is_far], vertices[is_far])


def test_teeth_of_the_rim_that_overlap_are_drawn_apart():
    """Their normals agree and no edge is sharp: only the intersection itself tells."""
    vertices, faces = make_lattice()
    faces = faces[~(np.isin(faces, 3).any(axis=1) & np.isin(faces, 2).any(axis=1))]  # a slit in the rim
    vertices[3, :2] += [0.3, -1.4]
    assert len(find_intersections(vertices, faces)) > 0
    mended, _ = unfold_faces(vertices, faces)
    assert len(find_intersections(mended, faces)) == 0
    assert len(find_folded_edges(mended, faces)) == 0
    is_far = np.abs(vertices[:, 1] - 3) > 3
    np.testing.assert_array_equal(mended[is_far], vertices[is_far])


def test_an_ear_keeps_its_corner():
    """A vertex that has slid out of the ear it lies in comes back; the ear's tip on the rim stays."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.9, 1.3, 0], [0.5, -1, 0]])
    faces = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [1, 0, 4]])
    mended, _ = unfold_faces(vertices, faces)
    assert not find_folded(mended, faces).any()
    assert len(find_folded_edges(mended, faces)) == 0
    np.testing.assert_array_equal(mended[[0, 1, 2, 4]], vertices[[0, 1, 2, 4]])


@pytest.mark.parametrize("height", [1.7, 4.0])
def test_a_spike_leaves_a_sheet_that_it_has_no_edge_in_common_with(height):
    vertices, faces = make_lattice(9)
    spike = int(np.argmin(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)))
    above = vertices + np.array([0.37, 0.37, 0.2])
    both = np.concatenate([vertices, above])
    sheets = np.concatenate([faces, faces + len(vertices)])
    both[spike, 2] = height
    assert len(find_intersections(both, sheets)) > 10
    is_movable = np.arange(len(both)) == spike
    mended, _ = unfold_faces(both, sheets, is_movable=is_movable)
    assert len(find_intersections(mended, sheets)) == 0
    np.testing.assert_array_equal(mended[~is_movable], both[~is_movable])


def test_sheets_that_cannot_be_parted_lose_the_faces_that_lie_across_others():
    """Two squares through one center: they shrink towards it, and stay across each other."""
    flat, sheet = make_lattice(2)
    flat -= flat.mean(axis=0)
    upright = flat @ Rotation.from_euler("zx", [0.3, 1.2]).as_matrix()
    vertices, faces = np.concatenate([flat, upright]), np.concatenate([sheet, sheet + len(flat)])
    assert len(find_intersections(vertices, faces)) > 0
    moved, kept = untangle(vertices, faces)
    assert len(find_intersections(moved, kept)) == 0
    assert not find_folded(moved, kept).any()
    np.testing.assert_array_equal(np.unique(kept), np.arange(len(moved)))
    assert len(kept) == 2


def test_an_edge_without_length_has_no_direction_in_single_precision_either():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    with np.errstate(all="raise"):
        assert np.isfinite(unfold_faces(vertices, np.array([[0, 1, 3], [1, 2, 3]]))[0]).all()


def test_what_did_not_change_need_not_be_looked_at_again(monkeypatch):
    vertices, faces = make_lattice(14)
    vertices += np.random.default_rng(0).normal(0, 0.6, vertices.shape)
    quick, is_tangled = unfold_faces(vertices, faces)
    find, every = unfolding.find_tangled, np.full(len(faces), True)
    monkeypatch.setattr(unfolding, "find_tangled", lambda *given: find(*given[:3], every, every))
    whole, wanted = unfold_faces(vertices, faces)
    np.testing.assert_array_equal(quick, whole)
    np.testing.assert_array_equal(is_tangled, wanted)
    assert not np.array_equal(quick, vertices)
