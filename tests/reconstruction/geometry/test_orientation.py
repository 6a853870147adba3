"""Surfaces look to where they were seen from: whole components, parts that are cut off, closed ones from within."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.orientation import (
    compute_components,
    find_doubtful_axis,
    find_up_axis,
    hangs_from_floor,
    is_room,
    looks_down_below,
    orient_outwards,
    orient_to_viewpoints,
    turn_reversed_parts,
)
from reconstruction._src.geometry.rows import compute_area_vectors
from reconstruction._src.geometry.sampling import choose_viewpoints, count_votes, find_visible, sample_area
from reconstruction._src.surfaces.quality import count_topology


def make_box(size: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """Return a box around the origin, subdivided, its normals outwards."""
    mesh = trimesh.creation.box((size, size, size)).subdivide().subdivide()
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def make_sheet(count: int = 21) -> tuple[np.ndarray, np.ndarray]:
    """Return a sheet of 2 (count - 1)^2 faces in the plane z = 0, normals up."""
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    quads = corner[:, None] + [0, count, count + 1, 1]
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


@pytest.mark.parametrize("is_inverted", [False, True])
@pytest.mark.parametrize(
    ("viewpoints", "sign"),
    [
        ([0.0, 0.0, 0.4], -1),
        ([[5.0, 0.0, 0.0], [0.0, -5.0, 0.0]], 1),
        ([[5, 0, 0], [0.2, 0.1, 0]], -1),
        (None, 1),
    ],
)
def test_a_box_looks_to_the_scanner_in_it_and_else_outwards(viewpoints, sign, is_inverted):
    box = trimesh.creation.box([2.0, 1.0, 1.0])
    if is_inverted:
        box.invert()
    views = None if viewpoints is None else np.array(viewpoints)
    turned = orient_outwards(np.asarray(box.vertices), np.asarray(box.faces), views)
    assert trimesh.Trimesh(box.vertices, turned, process=False).volume == pytest.approx(2.0 * sign)


def test_a_room_with_a_door_still_surrounds_the_scanner():
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide().subdivide()
    middle = room.triangles_center
    room.update_faces(~((middle[:, 0] > 1.99) & (np.abs(middle[:, 1]) < 0.8) & (middle[:, 2] < 0.0)))
    vertices = np.asarray(room.vertices)
    turned = orient_outwards(vertices, np.asarray(room.faces), np.array([1.5, 0.0, 0.0]))
    outwards = vertices[turned].mean(axis=1) * compute_area_vectors(vertices, turned)
    assert (outwards.sum(axis=1) < 0).all()


def test_a_sheet_looks_to_the_nearest_scanner_and_else_up():
    vertices, faces = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]])
    below = orient_outwards(vertices, faces, np.array([[0.2, 0.2, -1.0], [0.2, 0.2, 9.0]]))
    assert below.tolist() == [[2, 1, 0]]
    assert orient_outwards(vertices, below, None).tolist() == [[0, 1, 2]]


def test_a_room_from_outside_looks_down_below_and_terrain_does_not():
    box = trimesh.creation.box([4.0, 3.0, 2.5])
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    assert looks_down_below(vertices, faces)
    assert not looks_down_below(vertices, faces[:, ::-1])
    assert not looks_down_below(vertices, faces[box.triangles_center[:, 2] > 1.2])
    assert not looks_down_below(np.eye(3), np.array([[0, 1, 2]]))
    assert not looks_down_below(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))


def test_walls_stand_on_a_floor_or_it_is_seen_from_the_wrong_side():
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide()
    room.update_faces(room.triangles_center[:, 2] < 1.2)  # no ceiling
    room.invert()
    room.apply_translation([0.0, 0.0, 1.25])
    vertices, faces = np.asarray(room.vertices), np.asarray(room.faces)
    hanging = vertices * [1.0, 1.0, -1.0]  # the floor still looks up
    assert not hangs_from_floor(vertices, faces)
    assert hangs_from_floor(hanging, faces)
    assert not hangs_from_floor(0.08 * hanging, faces)  # too low to hang
    assert not hangs_from_floor(*_join((vertices, faces), (hanging, faces)))


@pytest.mark.parametrize("has_floor", [True, False])
def test_a_roof_is_no_floor_where_there_is_one_far_below(has_floor: bool):
    box, roof = trimesh.creation.box([4.0, 3.0, 2.5]), trimesh.creation.box([5.0, 4.0, 0.2])
    kept = np.abs(box.face_normals[:, 2]) < 0.5
    if has_floor:
        kept |= box.face_normals[:, 2] < 0.0
    inside = np.asarray(box.vertices) - [0.0, 0.0, 1.35], np.asarray(box.faces)[kept, ::-1]
    assert hangs_from_floor(*_join(inside, (np.asarray(roof.vertices), np.asarray(roof.faces)))) != has_floor


def _join(one, other):
    return np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1] + len(one[0])])


def test_another_axis_than_z_is_doubted_only_where_it_tells_more():
    floor, walls = np.array([[0.0, 0.0, 1.0]]), np.array([[2.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    tilted = 0.3 * np.array([[0.0, np.sin(0.2), np.cos(0.2)]])  # no floor square to z
    assert not find_doubtful_axis(np.concatenate([floor, walls]))
    assert not find_doubtful_axis(np.concatenate([0.3 * floor, walls]))  # few, but square
    axis = find_doubtful_axis(np.concatenate([tilted, walls]))
    assert axis.name == "x"
    assert "level along x" in axis.doubt
    assert not find_doubtful_axis(np.concatenate([tilted, 0.05 * walls]))
    rough = np.tile([[0.0, np.cos(0.3), np.sin(0.3)]], (5, 1))  # square to nothing
    assert find_up_axis(np.concatenate([rough, tilted]), np.arange(18.0).reshape(6, 3)) == "y"
    assert find_up_axis(np.concatenate([rough, 6 * tilted]), np.arange(18.0).reshape(6, 3)) is None


def test_a_room_with_more_ceiling_than_floor_has_its_axis_upwards():
    room = trimesh.creation.box([4.0, 2.5, 3.0]).subdivide().subdivide()
    room.invert()
    room.apply_transform(trimesh.transformations.rotation_matrix(0.3, [0, 1, 0]))
    is_floor = room.triangles_center[:, 1] < -1.2
    room.update_faces(~is_floor | (np.arange(len(is_floor)) % 2 == 0))
    areas, middles = np.asarray(room.face_normals * room.area_faces[:, None]), room.triangles_center
    assert find_up_axis(areas, middles) == "y"
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(areas), 1))
    assert find_up_axis(signs * areas, middles) == "y"  # points do not tell a ceiling from a floor
    is_above = middles[:, 1] > -1.2
    assert (
        find_up_axis((signs * areas)[is_above], middles[is_above]) == "-y"
    )  # a floor is below what else there is


def test_a_room_has_a_ceiling_that_looks_down():
    """Shelves above a floor look up as it does."""
    height, size = np.array([0.0, 2.0]), np.ones(2)
    assert is_room(np.array([1.0, -1.0]), size, height)
    assert not is_room(np.array([1.0, 1.0]), size, height)
    assert not is_room(np.array([-1.0, 1.0]), size, height)


def test_walls_of_a_room_are_voted_for_from_within_and_others_not_at_all():
    vertices, faces = make_box()
    points = sample_area(vertices, faces, 4000)
    inside = np.array([[0.5, 0.2, 0.1]])
    votes, weights = count_votes(vertices, faces, points, inside)
    assert (votes < 0).all()
    np.testing.assert_allclose(votes, -weights)
    left, _ = count_votes(vertices, faces, points[points[:, 0] < 0.0], inside)
    assert (left[vertices[faces][:, :, 0].min(axis=1) > 0.1] == 0).all()
    both = np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0]])
    seen_from = np.repeat([0, 1], len(points))
    votes, weights = count_votes(vertices, faces, np.concatenate([points, points]), both, seen_from)
    is_right = (vertices[faces][:, :, 0] > 1.99).all(axis=1)
    assert (np.abs(votes) < 0.2 * weights)[is_right].mean() > 0.9  # seen from both sides
    assert count_votes(vertices, faces[:0], points, both)[0].shape == (0,)
    assert (count_votes(vertices, faces, points[:0], both)[0] == 0).all()


def test_of_several_viewpoints_the_nearest_that_sees_the_point_is_taken():
    wall = np.stack(np.meshgrid(0.0, np.linspace(-2, 2, 161), np.linspace(-2, 2, 161)), -1).reshape(-1, 3)
    far = np.stack(np.meshgrid(1.0, np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), -1).reshape(-1, 3)
    viewpoints = np.array([[-1.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    chosen = choose_viewpoints(np.concatenate([wall, far]), viewpoints)
    assert (chosen[: len(wall)] == 0).mean() > 0.99
    assert (chosen[len(wall) :] == 1).mean() > 0.9
    assert find_visible(np.concatenate([wall, far]), viewpoints[0])[len(wall) :].mean() < 0.1


def test_components_turn_to_where_they_were_seen_from():
    vertices, faces = make_box()
    small = 0.2 * vertices + [0.5, 0.0, 0.0]
    both = np.concatenate([vertices, small])
    joined = np.concatenate([faces, faces[:, ::-1] + len(vertices)])
    points = np.concatenate([sample_area(vertices, faces, 4000), sample_area(small, faces, 4000)[:500]])
    viewpoint = np.array([[-1.0, 0.0, 0.0]])
    is_seen = find_visible(points, viewpoint[0])
    (_, turned), share = orient_to_viewpoints(both, joined, points[is_seen], viewpoint)
    np.testing.assert_array_equal(turned[: len(faces)], faces[:, ::-1])
    np.testing.assert_array_equal(turned[len(faces) :], joined[len(faces) :, ::-1])
    assert share > 0.95


def test_a_component_without_votes_looks_to_the_nearest_viewpoint():
    vertices, faces = make_box()
    (_, turned), share = orient_to_viewpoints(vertices, faces, np.full((1, 3), 99.0), np.zeros((1, 3)))
    np.testing.assert_array_equal(turned, faces[:, ::-1])
    assert share == 1.0
    assert orient_to_viewpoints(vertices, faces[:0], np.zeros((1, 3)), np.zeros((1, 3)))[1] == 1.0


def test_a_large_face_outvotes_slivers():
    vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [2, -0.05, 0], [-0.05, 2, 0], [2.05, 2.05, 0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4], [2, 1, 5]])
    viewpoints = np.array([[1.0, 1.0, 5.0], [1.0, 1.0, -5.0]])
    middle = vertices[faces].mean(axis=1)
    turned, _ = orient_to_viewpoints(vertices, faces, middle, viewpoints, np.array([0, 1, 1, 1]))
    assert compute_area_vectors(turned.vertices, turned.faces)[0, 2] > 0


def test_a_part_with_votes_for_its_back_is_cut_off_and_turned():
    vertices, faces = make_sheet()
    is_back = vertices[faces].mean(axis=1)[:, 0] < 0.4
    mesh = turn_reversed_parts(vertices, faces, np.where(is_back, -1.0, 1.0))
    np.testing.assert_array_equal(compute_area_vectors(mesh.vertices, mesh.faces)[:, 2] < 0, is_back)
    np.testing.assert_array_equal(mesh.vertices[: len(vertices)], vertices)
    assert len(mesh.vertices) == len(vertices) + 21
    part = compute_components(mesh.faces, len(mesh.vertices))
    assert part.max() == 1
    np.testing.assert_array_equal(part == part[0], is_back == is_back[0])
    assert count_topology(mesh.faces, len(mesh.vertices)).is_manifold


def test_few_faces_and_faces_without_votes_stay():
    vertices, faces = make_sheet()
    shares = np.ones(len(faces))
    shares[[5, 77, 300]] = -1.0
    shares[100:200] = 0.0
    mesh = turn_reversed_parts(vertices, faces, shares)
    assert mesh.vertices is vertices
    assert mesh.faces is faces


def test_faces_without_votes_go_with_their_neighbors():
    vertices, faces = make_sheet()
    away = np.abs(vertices[faces].mean(axis=1)[:, :2] - 0.5).max(axis=1)
    is_back = away < 0.3
    mesh = turn_reversed_parts(vertices, faces, np.where(is_back, -1.0, 1.0) * (away >= 0.1))
    np.testing.assert_array_equal(compute_area_vectors(mesh.vertices, mesh.faces)[:, 2] < 0, is_back)
    assert count_topology(mesh.faces, len(mesh.vertices)).is_manifold


def test_a_sheet_seen_from_both_sides_in_two_halves_looks_both_ways():
    vertices, faces = make_sheet()
    points = np.c_[np.random.default_rng(0).uniform(0, 1, (4000, 2)), np.zeros(4000)]
    viewpoints = np.array([[0.5, 0.5, 2.0], [0.2, 0.5, -2.0]])
    mesh, share = orient_to_viewpoints(vertices, faces, points, viewpoints, (points[:, 0] < 0.4) * 1)
    is_left = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] < 0.4
    np.testing.assert_array_equal(compute_area_vectors(mesh.vertices, mesh.faces)[:, 2] < 0, is_left)
    assert share == 1.0
