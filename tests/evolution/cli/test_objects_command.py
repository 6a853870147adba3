"""`symbrion arena --object`: finds known objects in a scan; refusals in one line."""

import numpy as np
import pytest
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from benchmarks.material.known_objects import make_socket
from evolution._src.cli.main import run


@pytest.fixture
def files(tmp_path):
    socket = make_socket()
    socket.export(tmp_path / "socket.stl")
    wall = trimesh.creation.box((0.1, 2.0, 2.0)).apply_translation((-0.05, 0, 0.5))
    trimesh.boolean.union([socket.copy().apply_translation((0, 0.2, 0.5)), wall]).export(
        tmp_path / "room.ply"
    )
    return tmp_path


@pytest.mark.slow
def test_objects_of_a_scan_are_placed_in_the_arena(files, capsys, monkeypatch):
    pytest.importorskip("cv2", reason="the extra 'objects' (opencv-contrib-python-headless) is absent")
    place = np.array([0.0, 0.2, 0.5])
    found = rc.FoundObject("socket", place, np.eye(3), score=1.0, coverage=0.9, num_beams=50)
    monkeypatch.setattr(rc, "find_objects", lambda scan, meshes, **options: [found] * ("socket" in meshes))
    room = str(files / "room.ply")
    words = ["--kind", "prisms", "--scan", room, "--object", str(files / "socket.stl")]
    assert run(["arena", room, *words, "--out", str(files / "arena")]) == 0
    assert "socket at 0.000, 0.200, 0.500 m" in capsys.readouterr().out
    (placed,) = sg.Arena.load(files / "arena").objects
    np.testing.assert_allclose(placed.position, place, atol=1e-9)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--object", "{files}/none.stl", "--scan", "{files}/room.ply"], "no such file"),
        (["--object", "{files}/socket.stl"], "--object and --scan belong together"),
        (["--scan", "{files}/room.ply"], "--object and --scan belong together"),
        (
            ["--scan", "{files}/room.ply", "--object", "{files}/socket.stl", "socket={files}/room.ply"],
            "two objects are called 'socket'",
        ),
    ],
)
def test_refusals_are_one_line(words, message, files, capsys):
    assert run(["arena", str(files / "room.ply"), *(word.format(files=files) for word in words)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_missing_extra_is_named(files, capsys, monkeypatch):
    monkeypatch.setattr("reconstruction._src.base.extras.find_spec", lambda name: None)
    words = ["--scan", str(files / "room.ply"), "--object", str(files / "socket.stl")]
    assert run(["arena", str(files / "room.ply"), *words]) == 1
    assert "symbrion-gym[objects]" in capsys.readouterr().err
