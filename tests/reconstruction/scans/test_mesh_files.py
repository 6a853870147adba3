"""Meshes, written by trimesh: faces, frames, and broken files."""

import json
import os
import struct
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damage import draw_damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_cloud
from reconstruction._src.scans.mesh_files import MESH_ENDINGS, is_mesh, load_mesh

BOX = trimesh.creation.box((1.0, 2.0, 3.0), trimesh.transformations.translation_matrix([0.5, 1.0, 1.5]))
Y_UP = (".glb", ".gltf", ".dae")


def write(folder: Path, ending: str, mesh: trimesh.Trimesh = BOX) -> Path:
    if ending == ".dae":
        pytest.importorskip("collada", reason="the extra `formats` is not installed")
    path = folder / f"box{ending}"
    if ending == ".gltf":
        for name, data in trimesh.Scene(mesh).export(file_type="gltf").items():
            (folder / name.replace("model", "box")).write_bytes(data)
    else:
        mesh.export(path)
    return path


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_faces_are_kept_in_meters_with_z_up(tmp_path: Path, ending: str) -> None:
    path = write(tmp_path, ending)
    assert is_mesh(path)
    mesh = load_mesh(path)
    assert len(mesh.faces) == 12
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(6.0)  # positive: the faces look outwards
    sizes = [1.0, 3.0, 2.0] if ending in Y_UP else [1.0, 2.0, 3.0]
    np.testing.assert_allclose(mesh.extents, sizes, atol=1e-6)
    np.testing.assert_array_equal(mesh.metadata["offset"], np.zeros(3))
    np.testing.assert_allclose(load_mesh(path, "cm", "z", 2.0).extents, [0.02, 0.04, 0.06], atol=1e-6)


@pytest.mark.parametrize("ending", [".stl", ".off", ".glb", ".dae", ".obj", ".ply"])
def test_the_vertices_are_the_points_of_its_cloud(tmp_path: Path, ending: str) -> None:
    path = write(tmp_path, ending)
    points = load_cloud(path).points
    expected = load_mesh(path).vertices
    assert {tuple(p) for p in points.round(6) + 0.0} == {tuple(p) for p in np.round(expected, 6) + 0.0}


def test_all_parts_of_a_scene_become_one_mesh(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for x in (0.0, 5.0):
        scene.add_geometry(BOX.copy(), transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb", up="z")
    assert len(mesh.faces) == 24
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], [6, 2, 3]], atol=1e-6)


@pytest.mark.parametrize(("up", "axis"), [("X_UP", "x"), ("Y_UP", "y"), ("Z_UP", "z")])
def test_a_dae_file_states_its_unit_and_axis(tmp_path: Path, up: str, axis: str) -> None:
    path = write(tmp_path, ".dae")
    text = path.read_text()
    head = f'<asset><unit name="inch" meter="0.0254"/><up_axis>{up}</up_axis></asset>'
    start, end = text.index("<asset>"), text.index("</asset>") + len("</asset>")
    path.write_text(text[:start] + head + text[end:])
    expected = load_mesh(path, "in", axis).extents
    np.testing.assert_allclose(load_mesh(path).extents, expected)
    assert load_mesh(path).extents[2] == pytest.approx(0.0254 * {"x": 1, "y": 2, "z": 3}[axis])


def test_large_coordinates_are_moved(tmp_path: Path) -> None:
    far = BOX.copy()
    far.apply_translation([512_700.0, 5_403_700.0, 300.0])
    path = tmp_path / "far.obj"
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in far.vertices.tolist()) + "f 1 2 3\nf 2 3 4\n")
    mesh = load_mesh(path)
    assert np.abs(mesh.vertices).max() < 5
    np.testing.assert_allclose(mesh.vertices + mesh.metadata["offset"], far.vertices[:4], rtol=0, atol=1e-6)


def test_points_are_no_mesh(tmp_path: Path) -> None:
    for name in ("a.ply", "a.obj"):
        trimesh.PointCloud(BOX.vertices).export(tmp_path / name)
        assert not is_mesh(tmp_path / name)
        with pytest.raises(ScanError, match=rf"{name}: holds no triangles.*load_cloud"):
            load_mesh(tmp_path / name)
    assert not is_mesh(tmp_path / "a.xyz")
    (tmp_path / "bad.ply").write_bytes(b"ply\nrubbish\n")
    with pytest.raises(ScanError, match=r"bad\.ply"):
        is_mesh(tmp_path / "bad.ply")


def glb(content: dict) -> bytes:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<IIII", 2, 20 + len(text), len(text), 0x4E4F534A) + text


def copies(num_nodes: int, num_parts: int, nested: bool = False) -> bytes:
    """Return a small .glb that has a mesh of 60,000 vertices many times."""
    nodes = [{"mesh": 0} for _ in range(num_nodes)]
    roots = list(range(num_nodes))
    if nested:
        nodes, roots = [*nodes, {"children": roots}], [num_nodes]
    accessor = {"bufferView": 0, "componentType": 5126, "count": 60_000, "type": "VEC3"}
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * num_parts}],
        "accessors": [accessor],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 720_000}],
        "buffers": [{"byteLength": 720_000}],
    }
    return glb(content) + struct.pack("<II", 720_000, 0x004E4942) + bytes(720_000)


@pytest.mark.parametrize("given", [(3000, 1), (1, 3000), (60, 60), (3000, 1, True)])
def test_copies_of_a_mesh_count(tmp_path: Path, given: tuple) -> None:
    (tmp_path / "a.glb").write_bytes(copies(*given))
    with pytest.raises(ScanError, match=r"a\.glb: takes more than the limit of 2 GB"):
        load_mesh(tmp_path / "a.glb")
    (tmp_path / "b.glb").write_bytes(copies(2, 1))
    assert len(load_mesh(tmp_path / "b.glb", max_bytes=8e6).vertices) == 120_000


def test_a_packed_dae_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.dae", "w") as archive:
        archive.writestr("a.dae", " " * 1000)
    with pytest.raises(ScanError, match=r"a\.dae: is a zip archive; unpack it"):
        load_mesh(tmp_path / "a.dae")


BROKEN = {
    "empty.stl": b"",
    "cut.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n",
    "nan.off": b"OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n",
    "index.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
    "garbage.glb": bytes(range(256)),
    "bomb.glb": glb({"asset": {"version": "2.0"}, "accessors": [{"count": 10**12, "componentType": 5126}]}),
    "counts.gltf": b'{"accessors": [{"count": "many"}]}',
    "deep.gltf": b"[" * 100_000,
    "garbage.dae": b"<COLLADA>",
    "kind.xyz": b"1 2 3\n",
    "a.stl.gz": b"x",
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_named_with_the_reason(tmp_path: Path, name: str) -> None:
    if name.endswith(".dae"):
        pytest.importorskip("collada", reason="the extra `formats` is not installed")
    (tmp_path / name).write_bytes(BROKEN[name])
    with pytest.raises(ScanError, match=rf"{name}: "):
        load_mesh(tmp_path / name)


def test_absent_and_large_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScanError, match="no such file"):
        load_mesh(tmp_path / "absent.stl")
    with pytest.raises(ScanError, match=r"box\.stl: takes more than the limit"):
        load_mesh(write(tmp_path, ".stl"), max_bytes=100)
    with pytest.raises(ScanError, match="up='down'"):
        load_mesh(write(tmp_path, ".stl"), up="down")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of trimesh, about numbers that are none
@pytest.mark.parametrize("ending", [".stl", ".off", ".glb", ".ply", ".obj"])
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_give_a_mesh_or_the_error(tmp_path: Path, ending: str, data: st.DataObject) -> None:
    path = tmp_path / f"box{ending}"
    content = (path if path.exists() else write(tmp_path, ending)).read_bytes()
    damaged = tmp_path / f"damaged{ending}"
    damaged.write_bytes(draw_damaged(data, content))
    try:
        mesh = load_mesh(damaged, max_bytes=1e6)
    except ScanError:
        return
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.max() < len(mesh.vertices)


def test_a_mesh_in_the_plane_is_refused(tmp_path: Path) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n")
    with pytest.raises(ScanError, match=r"flat.obj: has vertices of 2 coordinates"):
        load_mesh(tmp_path / "flat.obj")


@pytest.mark.data
def test_a_texture_starts_no_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pillow goes by the content of a picture, and hands PostScript to Ghostscript."""
    plugin = pytest.importorskip("PIL.EpsImagePlugin")
    monkeypatch.setattr(plugin, "gs_binary", None)
    (tmp_path / "gs").write_text(f"#!/bin/sh\ntouch {tmp_path / 'started'}\n")
    (tmp_path / "gs").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    (tmp_path / "a.png").write_bytes(
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 48\n%%EndComments\nshowpage\n%%EOF\n"
    )
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    path = tmp_path / "a.obj"
    path.write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"
    )
    with suppress(ScanError):
        load_mesh(path)
    assert not (tmp_path / "started").exists()


def test_a_real_mesh(shared_data: Path) -> None:
    assert is_mesh(shared_data / "stanford-bunny.obj")
    assert len(load_mesh(shared_data / "stanford-bunny.obj").faces) == 69_451
