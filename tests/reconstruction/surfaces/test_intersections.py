"""Cases known by hand of surfaces that pass through themselves or double back."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.surfaces.intersections import find_folded_edges, find_intersections

LEVEL = [[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]


def find_pairs(vertices: list, faces: list) -> list:
    return find_intersections(np.array(vertices, float), np.array(faces)).tolist()


def test_two_triangles_that_cross():
    standing = [[0.3, 0.3, -1], [0.6, 0.3, 1], [0.3, 0.6, 1]]
    assert find_pairs(LEVEL + standing, [[0, 1, 2], [3, 4, 5]]) == [[0, 1]]
    above = np.add(standing, [0, 0, 1.01]).tolist()
    assert find_pairs(LEVEL + above, [[0, 1, 2], [3, 4, 5]]) == []


def test_two_triangles_that_overlap_in_one_plane():
    shifted = np.add(LEVEL, [0.5, 0.5, 0]).tolist()
    assert find_pairs(LEVEL + shifted, [[0, 1, 2], [3, 4, 5]]) == [[0, 1]]
    shifted = np.add(LEVEL, [2.5, 0, 0]).tolist()
    assert find_pairs(LEVEL + shifted, [[0, 1, 2], [3, 4, 5]]) == []


def test_a_shared_corner_alone_is_no_intersection():
    apart = [[-2.0, 0, 0], [0, -2, 0]]
    assert find_pairs(LEVEL + apart, [[0, 1, 2], [0, 3, 4]]) == []
    through = [[1.0, 0.5, -1], [0.5, 1, 1]]
    assert find_pairs(LEVEL + through, [[0, 1, 2], [0, 3, 4]]) == [[0, 1]]
    over = [[1.0, 0.5, 0], [0.5, 1, 0]]
    assert find_pairs(LEVEL + over, [[0, 1, 2], [0, 3, 4]]) == [[0, 1]]


@pytest.mark.parametrize(("angle", "folds"), [(0, 0), (90, 0), (110, 0), (130, 1), (179, 1), (180, 1)])
def test_a_shared_edge_is_a_fold_beyond_its_angle(angle, folds):
    turn = np.deg2rad(angle)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.5, -1, 0], [0.5, np.cos(turn), np.sin(turn)]])
    for other in ([0, 1, 3], [1, 0, 3]):  # wound alike, and not
        faces = np.array([[1, 0, 2], other])
        assert len(find_folded_edges(vertices, faces)) == folds
        assert len(find_intersections(vertices, faces)) == 0


def test_a_sheet_has_none_and_a_pulled_vertex_makes_some():
    index = np.arange(64).reshape(8, 8)
    corners = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = trimesh.geometry.triangulate_quads(np.stack(corners, axis=-1).reshape(-1, 4))
    vertices = np.insert(np.argwhere(index >= 0).astype(float), 2, 0.0, axis=1)
    assert len(find_intersections(vertices, faces)) == len(find_folded_edges(vertices, faces)) == 0
    vertices[:, 2] = np.random.default_rng(0).normal(0, 0.05, len(vertices))
    assert len(find_intersections(vertices, faces)) == len(find_folded_edges(vertices, faces)) == 0
    vertices[27] += [1.6, 1.3, 0]
    assert len(find_intersections(vertices, faces)) > 0
    assert len(find_folded_edges(vertices, faces)) > 0


def test_selected_faces_and_sizes_apart_change_nothing():
    rng = np.random.default_rng(0)
    size = 10 ** rng.uniform(-2, 0, 300)
    corners = rng.random((300, 1, 3)) + size[:, None, None] * rng.normal(size=(300, 3, 3)) / 4
    vertices, faces = corners.reshape(-1, 3), np.arange(900).reshape(-1, 3)
    pairs = find_intersections(vertices, faces)
    assert len(pairs) > 100
    is_selected = rng.random(300) < 0.2
    wanted = pairs[is_selected[pairs].any(axis=1)]
    np.testing.assert_array_equal(find_intersections(vertices, faces, is_selected), wanted)
    order = rng.permutation(300)
    again = np.sort(order[find_intersections(vertices, faces[order])], axis=1)
    np.testing.assert_array_equal(np.unique(again, axis=0), pairs)


def test_faces_without_area_are_left_out():
    assert find_pairs([*LEVEL, [0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, 0.5, 0]], [[0, 1, 2], [3, 4, 5]]) == []
    assert find_pairs(LEVEL, [[0, 1, 2]]) == []
    assert len(find_intersections(np.zeros((3, 3)), np.zeros((0, 3), int))) == 0
