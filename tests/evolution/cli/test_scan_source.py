"""`symbrion reconstruct`: which points of which files it takes, and what it asks about."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from test_cli import refuse

from evolution._src.cli.commands.reconstruct import Reconstruct
from evolution._src.cli.main import _parse, run
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.scans.scan import ScanLog

SHEET = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 0.01], (2000, 3))


def write(path, points: np.ndarray):
    np.savez(path, points=points)
    return path


@pytest.mark.slow
def test_the_offset_viewpoints_and_all_readings_are_kept(tmp_path, capsys):
    far = SHEET + np.array([500_000.0, 5_403_700.0, 300.0])
    path, out = write(tmp_path / "far.npz", far), tmp_path / "out.npz"
    words = ["--viewpoint", "500000", "5403700", "302", "500001", "5403700", "302", "--thin", "0.1"]
    assert run(["reconstruct", str(path), "--out", str(out), "--units", "60", *words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["offset"] == [500_000.0, 5_403_700.0, 300.0]
    assert summary["viewpoints"] == 2
    assert summary["readings"] == 2000
    assert summary["points"] < 600
    surface = Reconstruction.load(out)
    np.testing.assert_allclose(surface.viewpoints, [[0, 0, 2], [1, 0, 2]])
    assert (surface.mesh.face_normals[:, 2] > 0).all()


@pytest.mark.slow
def test_the_offset_is_printed_with_all_digits(tmp_path, capsys):
    path = write(tmp_path / "far.npz", SHEET + np.array([500_000.0, 5_403_706.0, 300.0]))
    assert run(["reconstruct", str(path), "--out", str(tmp_path / "a.npz"), "--units", "60", "--quiet"]) == 0
    output = capsys.readouterr().out
    assert "500000, 5403706, 300 m were subtracted" in output
    assert "far.npz: 2000 points" in output


def test_a_surface_seen_from_below_looks_down(tmp_path):
    path, out = write(tmp_path / "a.npz", SHEET), tmp_path / "out.npz"
    assert (
        run(["reconstruct", str(path), "--out", str(out), "--units", "60", "--viewpoint", "0", "0", "-2"])
        == 0
    )
    assert (Reconstruction.load(out).mesh.face_normals[:, 2] < 0).all()


@pytest.mark.parametrize("factor", [2000.0, 0.01])
def test_an_odd_size_is_asked_about(tmp_path, factor, capsys):
    path = write(tmp_path / "a.npz", SHEET * factor)
    words = ["reconstruct", str(path), "--out", str(tmp_path / "out.npz"), "--units", "60", "--quiet"]
    line = refuse(words, 2, capsys)
    assert "its longest side is" in line
    assert all(option in line for option in ("--unit m", "--scale", "--crop auto"))
    assert not (tmp_path / "out.npz").exists()
    assert run([*words, "--unit", "m"]) == 0
    capsys.readouterr()
    assert run([*words, "--scale", str(1 / factor)]) == 0
    assert "longest side" not in capsys.readouterr().err


def test_crop_auto_drops_strays(tmp_path):
    path = write(tmp_path / "a.npz", np.concatenate([SHEET, [[5e4, 0, 0], [0, -3e3, 1]]]))
    scan = Reconstruct(source=path, out=tmp_path / "a.ply", crop="auto", raw=True).read_scan()
    assert scan.points.num_points == scan.readings.num_points == 2000


def test_a_box_is_in_the_coordinates_of_the_file(tmp_path, capsys):
    far = SHEET + np.array([500_000.0, 0.0, 0.0])
    path = write(tmp_path / "a.npz", far)
    box = (500_000.0, 500_001.0, -1.0, 1.0, -1.0, 1.0)
    scan = Reconstruct(source=path, out=tmp_path / "a.ply", crop=box, raw=True).read_scan()
    np.testing.assert_allclose(scan.points.points + scan.points.offset, far[far[:, 0] >= 500_000])
    words = ["reconstruct", str(path), "--crop", "0", "1", "0", "1", "0", "1", "--quiet", "--out"]
    line = refuse([*words, str(tmp_path / "a.ply")], 2, capsys)
    assert "--crop leaves none" in line
    assert "x 499999 to 500001" in line


def test_units_axes_and_scale_reach_the_points(tmp_path):
    path = write(tmp_path / "a.npz", SHEET)
    options = {"unit": "ft", "up": "-y", "scale": 2.0, "raw": True}
    points = Reconstruct(source=path, out=tmp_path / "a.ply", **options).read_scan().points.points
    np.testing.assert_allclose(points, SHEET[:, [0, 2, 1]] * 0.6096 * [1, 1, -1])


def test_axes_with_a_sign_are_read_from_the_command_line(tmp_path):
    path = write(tmp_path / "a.npz", SHEET)
    command = _parse(
        ["reconstruct", str(path), "--up", "-y", "--viewpoint", "-1", "0", "-2.5", "--crop", "auto"]
    )
    assert isinstance(command, Reconstruct)
    assert (command.up, command.viewpoint, command.crop) == ("-y", ((-1.0, 0.0, -2.5),), "auto")


def test_a_mesh_is_sent_to_the_arena(tmp_path, capsys):
    for name in ("box.obj", "box.stl", "box.ply", "box.glb"):
        trimesh.creation.box((1, 1, 1)).subdivide_loop(3).export(tmp_path / name)
        words = ["reconstruct", f"{tmp_path / name}", *f"--out {tmp_path}/out.npz --units 60 --quiet".split()]
        line = refuse(words, 2, capsys)
        assert f"symbrion arena {tmp_path / name} --out arenas/box" in line
        assert "--vertices" in line
    assert run([*words, "--vertices"]) == 0


def test_a_log_keeps_which_scan_saw_what(tmp_path, capsys):
    poses = np.tile(np.eye(4), (40, 1, 1))
    poses[:, :3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    poses[:, :3, 3] = np.c_[0.05 * np.arange(40), np.zeros(40), np.full(40, 0.5)]
    angles = np.linspace(-2.2, -0.9, 60)
    log = ScanLog(np.tile(0.5 / -np.sin(angles), (40, 1)), angles, poses)
    path = log.save(tmp_path / "log.npz")
    scan = Reconstruct(source=path, out=tmp_path / "a.ply").read_scan()
    assert scan.points.viewpoints is not None
    assert len(scan.points.viewpoints) == 40
    origins = scan.points.origins
    assert origins is not None
    assert np.abs(scan.points.points[:, 0] - origins[:, 0]).max() < 0.02
    line = refuse(
        ["reconstruct", str(path), "--out", str(tmp_path / "a.ply"), "--up", "y", "--quiet"], 2, capsys
    )
    assert "omit --up" in line


@pytest.mark.slow
def test_a_depth_image_becomes_a_surface_with_its_viewpoint(tmp_path, capsys):
    np.save(tmp_path / "depth.npy", np.full((40, 60), 2000, np.uint16))
    words = ["reconstruct", str(tmp_path / "depth.npy"), "--out", str(tmp_path / "a.npz"), "--units", "60"]
    camera = ["--intrinsics", "50", "50", "29.5", "19.5"]
    assert run([*words, *camera, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["viewpoints"] == 1
    assert (Reconstruction.load(tmp_path / "a.npz").mesh.face_normals[:, 0] < 0).all()


@pytest.mark.parametrize(
    ("name", "words", "reason"),
    [
        ("a.png", [], "--intrinsics FX FY CX CY"),
        ("a.xyz", ["--intrinsics", "1", "1", "0", "0"], "belong to a depth image"),
        ("a.png", ["--intrinsics", "1", "1", "0", "0", "--up", "y"], "no --unit, --up or --viewpoint"),
        ("a.xyz", ["--depth-scale", "0.1"], "give --intrinsics, too"),
        ("a.xyz", ["--scale", "0"], "--scale 0.0 must be a finite number above 0"),
        ("a.xyz", ["--viewpoint", "0", "0"], "viewpoint"),
        ("a.xyz", ["--viewpoint", "0", "0", "nan"], "--viewpoint"),
        ("a.xyz", ["--unit", "inch"], "inch"),
        ("a.xyz", ["--crop", "some"], "crop"),
        ("a.png", ["--intrinsics", "1", "1", "0", "0", "--color-image", "absent.png"], "--color-image"),
    ],
)
def test_options_that_do_not_fit_are_refused(name, words, reason, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path(name).write_text("0 0 0\n1 0 0\n0 1 0\n0 0 1\n")
    assert reason in refuse(["reconstruct", name, "--out", "a.npz", *words], 2, capsys)
