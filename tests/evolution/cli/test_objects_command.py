"""`symbrion objects`: finds in a scan, into an arena; refusals in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from benchmarks.material.known_objects import make_socket
from evolution._src.cli.main import run


@pytest.fixture
def files(tmp_path: Path) -> Path:
    socket = make_socket()
    socket.export(tmp_path / "socket.stl")
    wall = trimesh.creation.box((0.1, 2.0, 2.0)).apply_translation((-0.05, 0, 0.5))
    trimesh.boolean.union([socket.copy().apply_translation((0, 0.2, 0.5)), wall]).export(
        tmp_path / "room.ply"
    )
    sg.load_arena("truth").save(tmp_path / "arena")
    return tmp_path


def test_objects_of_a_scan_are_added_to_an_arena(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cv2", reason="the extra 'objects' (opencv-contrib-python-headless) is absent")
    words = [str(files / "room.ply"), "--object", str(files / "socket.stl"), "--add-to", str(files / "arena")]
    assert run(["objects", *words, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["objects"]
    assert found["name"] == "socket"
    np.testing.assert_allclose(found["position"], (0, 0.2, 0.5), atol=0.005)
    (placed,) = sg.Arena.load(files / "arena").objects
    assert placed.position.tolist() == found["position"]


def test_an_arena_that_is_made_again_keeps_its_objects(
    files: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    words = ["arena", str(files / "room.ply"), "--kind", "prisms", "--out", str(files / "made")]
    assert run(words) == 0
    assert "known objects" not in capsys.readouterr().out
    made, found = sg.Arena.load(files / "made"), rc.FoundObject("socket", np.ones(3), np.eye(3), 1.0, 1.0, 50)
    sg.place_objects(made, [found], {"socket": make_socket()}).save(files / "made")
    assert run(words) == 0
    assert "known objects that were there: 1 kept" in capsys.readouterr().out
    (kept,) = sg.Arena.load(files / "made").objects
    assert kept.position.tolist() == [1.0, 1.0, 1.0]
    far = trimesh.load_mesh(files / "room.ply").apply_translation((5000.0, 0.0, 0.0))
    far.export(files / "room.ply")
    assert run(words) == 0
    assert "1 dropped, as the surface lies in another frame" in capsys.readouterr().out
    assert not sg.Arena.load(files / "made").objects
    assert "its 1 known objects are replaced by none" in caplog.text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "no object to find"),
        (["--object", "{files}/none.stl"], "no such file"),
        (["--object", "{files}/socket.stl", "socket={files}/room.ply"], "two objects are called 'socket'"),
        (["--object", "{files}/socket.stl", "--add-to", "{files}"], "is no arena"),
        (["--object", "{files}/socket.stl", "--noise", "-1"], "ObjectsConfig.noise"),
    ],
)
def test_refusals_are_one_line(
    words: list[str], message: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = str(files / "room.ply")
    assert run(["objects", scan, *(word.format(files=files) for word in words)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_missing_extra_is_named(
    files: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reconstruction._src.base.extras.find_spec", lambda name: None)
    assert run(["objects", str(files / "room.ply"), "--object", str(files / "socket.stl")]) == 1
    assert "symbrion-gym[objects]" in capsys.readouterr().err
