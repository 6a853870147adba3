"""Known objects found in scans of a made room, with the library of the extra `objects`."""

import numpy as np
import pytest

import reconstruction as rc
from benchmarks.material.known_objects import make_socket
from benchmarks.objects import judge
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.objects.finding import Candidate, suppress
from reconstruction._src.objects.model import make_model
from reconstruction._src.objects.verification import Verdict

MESHES = {"socket": make_socket()}


def make_scan(num_objects, seed=40, **changes):
    pytest.importorskip("embreex", reason="scans of made rooms need the extra 'embree'")
    from benchmarks.material.object_rooms import RoomScan, make_survey

    how = RoomScan(**{"noise": 0.003, **changes})
    return make_survey(MESHES, seed, num_objects, how)


@pytest.fixture
def library():
    return pytest.importorskip("cv2", reason="the extra 'objects' (opencv-contrib-python-headless) is absent")


@pytest.mark.slow
def test_sockets_are_found_with_their_poses(library):
    survey = make_scan(2)
    found = rc.find_objects(survey.cloud, MESHES)
    judged = judge(survey, found, MESHES)
    assert (judged.found, judged.false) == (2, 0)
    assert max(judged.position_mm) < 20
    assert max(judged.angle_deg) < 5
    assert all(each.score > 0.94 and each.num_beams > 40 for each in found)


@pytest.mark.slow
def test_an_empty_room_has_no_objects(library):
    assert rc.find_objects(make_scan(0, step=0.6, num_viewpoints=2).cloud, MESHES) == []


@pytest.mark.slow
def test_objects_are_found_in_a_mesh(library):
    import trimesh

    socket = MESHES["socket"].copy().apply_translation((0, 0.2, 0.5))
    wall = trimesh.creation.box((0.1, 2.0, 2.0)).apply_translation((-0.05, 0, 0.5))
    room = trimesh.boolean.union([socket, wall])
    (found,) = rc.find_objects(room, MESHES)
    np.testing.assert_allclose(found.position, (0, 0.2, 0.5), atol=0.005)
    np.testing.assert_allclose(found.rotation, np.eye(3), atol=0.05)
    (again,) = rc.find_objects(room, MESHES)
    np.testing.assert_array_equal(again.position, found.position)
    np.testing.assert_array_equal(again.rotation, found.rotation)
    assert again.score == found.score


def test_without_objects_there_is_nothing_to_find(library):
    with pytest.raises(ReconstructionError, match="objects is empty"):
        rc.find_objects(np.zeros((10, 3)), {})


def test_a_missing_library_is_named_in_one_line(monkeypatch):
    monkeypatch.setattr("reconstruction._src.base.extras.find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match=r"extra 'objects' .*cv2.*symbrion-gym\[objects\]"):
        rc.find_objects(np.zeros((10, 3)), MESHES)


def test_of_two_finds_at_one_place_the_better_is_kept():
    model = make_model("socket", MESHES["socket"])
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[1, 0, 3], poses[2, 0, 3] = 0.01, 0.4
    found = [
        Candidate(model, pose, Verdict(score, 1.0, 100))
        for pose, score in zip(poses, (0.95, 0.99, 0.96), strict=True)
    ]
    assert suppress(found) == [found[1], found[2]]


@pytest.mark.slow
def test_nothing_is_found_where_the_noise_hides_the_shape(library, caplog):
    assert rc.find_objects(make_scan(2, noise=0.02).cloud, MESHES) == []
    assert "socket is not searched: with a noise of 15 mm" in caplog.text
