"""Far faces after a change are those that a look at all faces finds, and faces are known again by their corners."""

import numpy as np
import pytest

import reconstruction as rc
from reconstruction._src.surfaces.far_faces import SeenPoints, measure_far_faces
from reconstruction._src.surfaces.far_updates import (
    Sheet,
    find_beside_none,
    find_same_faces,
    update_far_faces,
)
from reconstruction._src.surfaces.unfolding import find_folded, unfold_part


def make_floor(num: int = 17, size: float = 4.0) -> Sheet:
    side = np.linspace(-size / 2, size / 2, num)
    vertices = np.stack([*np.meshgrid(side, side), np.zeros((num, num))], axis=-1).reshape(-1, 3)
    corner = (np.arange(num - 1)[:, None] * num + np.arange(num - 1)).ravel()
    first = np.stack([corner, corner + 1, corner + num], axis=1)
    second = np.stack([corner + 1, corner + num + 1, corner + num], axis=1)
    return Sheet(vertices, np.concatenate([first, second]))


def read_floor(num: int = 121, size: float = 4.0) -> np.ndarray:
    side = np.linspace(-size / 2, size / 2, num)
    return np.stack([*np.meshgrid(side, side), np.zeros((num, num))], axis=-1).reshape(-1, 3)


def test_faces_are_known_again_by_their_corners():
    old = make_floor()
    vertices = old.vertices.copy()
    vertices[40, 2] += 1e-12
    order = np.random.default_rng(0).permutation(len(old.faces))
    place = find_same_faces(old, Sheet(vertices, old.faces[order]))
    is_touched = (old.faces[order] == 40).any(axis=1)
    np.testing.assert_array_equal(place[~is_touched], order[~is_touched])
    assert (place[is_touched] == -1).all()
    assert is_touched.any()


def test_where_readings_are_gone_faces_become_far_as_a_look_at_all_finds():
    sheet, points = make_floor(33), read_floor()
    is_gone = np.linalg.norm(points[:, :2] - 0.5, axis=1) < 1.0
    cloud = SeenPoints(points[~is_gone])
    before = measure_far_faces(*sheet, SeenPoints(points))
    assert not before.is_far.any()
    after = update_far_faces(before, sheet, sheet, points[is_gone], cloud)
    assert after.is_far.any()
    np.testing.assert_array_equal(after.is_far, measure_far_faces(*sheet, cloud).is_far)


def test_far_faces_are_near_again_once_they_are_read():
    sheet, points = make_floor(33), read_floor()
    is_gone = np.linalg.norm(points[:, :2] - 0.5, axis=1) < 1.0
    before = measure_far_faces(*sheet, SeenPoints(points[~is_gone]))
    after = update_far_faces(before, sheet, sheet, points[:0], SeenPoints(points))
    assert before.is_far.any()
    assert not after.is_far.any()


def test_samples_beside_no_point_are_those_without_one_in_their_cell():
    points = np.zeros((1, 3))
    samples = np.array([[0.001, 0.001, 0.001], [0.5, 0.0, 0.0], [-0.2, 0.0, 0.0]])
    np.testing.assert_array_equal(find_beside_none(samples, points, 0.1), [False, True, True])


@pytest.mark.parametrize("distance", [0.05, 0.3])
def test_no_sample_that_is_left_out_is_farther_than_the_distance(distance):
    rng = np.random.default_rng(0)
    samples, points = rng.random((500, 3)), rng.random((200, 3))
    nearest = np.linalg.norm(samples[:, None] - points, axis=2).min(axis=1)
    is_open = find_beside_none(samples, points, distance)
    assert (nearest[~is_open] <= distance).all()
    assert (~is_open).any()


def test_only_movable_vertices_are_unfolded():
    sheet = make_floor(9)
    vertices = sheet.vertices.copy()
    for vertex in (20, 60):
        vertices[vertex, :2] += [0.8, 0.15]
    is_movable = np.zeros(len(vertices), dtype=bool)
    is_movable[20] = True
    mended = unfold_part(vertices, sheet.faces, is_movable)
    np.testing.assert_array_equal(mended[~is_movable], vertices[~is_movable])
    assert not find_folded(mended, sheet.faces)[(sheet.faces == 20).any(axis=1)].any()
    assert find_folded(mended, sheet.faces)[(sheet.faces == 60).any(axis=1)].any()
    assert unfold_part(vertices, sheet.faces, np.zeros(len(vertices), dtype=bool)) is vertices


def test_a_refined_surface_is_the_same_once_saved_and_loaded(tmp_path):
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(-1, 1, (12_000, 2)), rng.normal(0, 0.003, 12_000)]
    first = rc.reconstruct(floor, units=300)
    new = floor[np.abs(floor[:, :2]).max(axis=1) < 0.5] + [0.0, 0.0, 0.05]
    refined = first.refine(new)
    refined.save(tmp_path / "refined.npz")
    loaded = rc.Reconstruction.load(tmp_path / "refined.npz")
    assert not np.array_equal(refined.mesh.vertices, first.mesh.vertices)
    np.testing.assert_array_equal(loaded.mesh.vertices, refined.mesh.vertices)
    np.testing.assert_array_equal(loaded.mesh.faces, refined.mesh.faces)
    first.save(tmp_path / "first.npz")
    assert "far_is_far" not in np.load(tmp_path / "first.npz")


def test_a_file_that_tells_far_faces_of_another_mesh_is_refused(tmp_path):
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(-1, 1, (4_000, 2)), rng.normal(0, 0.003, 4_000)]
    path = tmp_path / "refined.npz"
    rc.reconstruct(floor, units=100).refine(floor + np.array([0.0, 0.0, 0.1])).save(path)
    arrays = dict(np.load(path))
    arrays["far_is_far"] = arrays["far_is_far"][:-1]
    np.savez(path, **arrays)
    with pytest.raises(rc.ReconstructionError, match="truth value of each"):
        rc.Reconstruction.load(path)
