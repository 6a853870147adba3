"""PLY files as other programs write them, and headers that lie."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_points, save_points

UTM = np.random.default_rng(0).uniform(size=(40, 3)) * [100, 100, 10] + [448_262.1, 5_411_932.7, 112.0]
"""Coordinates that single precision would move by decimeters [m]."""
FACES = np.arange(39).reshape(-1, 3)


def load(folder: Path, content: bytes) -> np.ndarray:
    (folder / "a.ply").write_bytes(content)
    return load_points(folder / "a.ply")


def test_points_are_written_in_double_for_others_to_read(tmp_path: Path) -> None:
    path = save_points(tmp_path / "a.ply", UTM)
    np.testing.assert_array_equal(load_points(path), UTM)
    cloud = trimesh.load(path)
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_array_equal(cloud.vertices, UTM)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_files_of_trimesh_are_read(tmp_path: Path, encoding: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.visual.vertex_colors = np.random.default_rng(0).integers(0, 255, (len(ball.vertices), 4))
    cloud = trimesh.PointCloud(ball.vertices, colors=ball.visual.vertex_colors)
    for content in (
        ball.export(file_type="ply", encoding=encoding, vertex_normal=True),
        cloud.export(file_type="ply", encoding=encoding),
    ):
        np.testing.assert_allclose(load(tmp_path, content), ball.vertices, atol=1e-6)


HEADER = """ply
format {form} 1.0
comment Créé par un autre programme, element vertex 9
obj_info num_cols 512
element camera 2
property float view_px
property uchar kind
element range_grid 3
property list uchar int vertex_indices
element vertex {count}
property double x
property uchar red
property double y
{extra}property double z
element face 13
property list uchar int vertex_indices
end_header
"""
TEXTURE = "property list uchar float texture\n"


def write_binary(order: str, extra: str) -> bytes:
    """Write rows before, in and after the vertices, with lists of different lengths."""
    rows = [struct.pack(f"{order}fB", 1.5, 7) * 2]
    rows += [struct.pack(f"{order}B{n}i", n, *range(n)) for n in (0, 3, 1)]
    for i, (x, y, z) in enumerate(UTM):
        rows += [struct.pack(f"{order}dBd", x, i, y)]
        rows += [struct.pack(f"{order}B{i % 3}f", i % 3, *range(i % 3))] if extra else []
        rows += [struct.pack(f"{order}d", z)]
    return b"".join(rows + [struct.pack(f"{order}B3i", 3, *face) for face in FACES])


def write_ascii() -> bytes:
    rows = ["1.5 7", "1.5 7", "0", "3 0 1 2", "1 0", ""]
    rows += [f"{x!r} {i} {y!r} {z!r}" for i, (x, y, z) in enumerate(UTM.tolist())]
    return "\n".join(rows + [f"3 {a} {b} {c}" for a, b, c in FACES]).encode()


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("form", "extra"),
    [
        ("ascii", ""),
        ("binary_little_endian", ""),
        ("binary_big_endian", ""),
        ("binary_little_endian", TEXTURE),
        ("binary_big_endian", TEXTURE),
    ],
)
def test_other_elements_and_properties_do_not_disturb(
    tmp_path: Path, form: str, newline: str, extra: str
) -> None:
    header = HEADER.format(form=form, count=len(UTM), extra=extra).replace("\n", newline).encode("latin1")
    body = write_ascii() if form == "ascii" else write_binary("<>"["big" in form], extra)
    np.testing.assert_array_equal(load(tmp_path, header + body), UTM)


@pytest.mark.parametrize(
    ("name", "code"), [("char", "b"), ("uint16", "H"), ("int", "i"), ("float32", "f"), ("double", "d")]
)
def test_types_are_read(tmp_path: Path, name: str, code: str) -> None:
    properties = "".join(f"property {name} {axis}\n" for axis in "xyz")
    header = f"ply\nformat binary_big_endian 1.0\nelement vertex 4\n{properties}end_header\n"
    body = struct.pack(f">12{code}", *range(12))
    np.testing.assert_array_equal(load(tmp_path, header.encode() + body), np.arange(12).reshape(4, 3))


GOOD = HEADER.format(form="binary_little_endian", count=40, extra=TEXTURE).encode()
MANY = b"999999999999999999"


@pytest.mark.parametrize(
    "header",
    [
        GOOD.replace(b"element range_grid 3", b"element range_grid " + MANY),
        GOOD.replace(b"element vertex 40", b"element vertex " + MANY),
        GOOD.replace(b"element vertex 40", b"element vertex -1"),
        GOOD.replace(b"list uchar float", b"list int float"),
        GOOD.replace(b"list uchar float", b"list uchar quaternion"),
        GOOD.replace(b"property double z\n", b""),
        GOOD.replace(b"property double z", b"property double x"),
        GOOD.replace(b"property double z", b"property list uchar double z"),
        GOOD.replace(b"element camera 2\n", b""),
        GOOD.replace(b"end_header\n", b""),
        GOOD[1:],
    ],
)
def test_headers_that_lie_are_refused(tmp_path: Path, header: bytes) -> None:
    with pytest.raises(ScanError, match=r"a\.ply"):
        load(tmp_path, header + write_binary("<", TEXTURE))


def test_ascii_rows_that_are_missing_or_broken_are_refused(tmp_path: Path) -> None:
    header = HEADER.format(form="ascii", count=40, extra="").encode()
    lines = write_ascii().split(b"\n")
    for broken in (lines[:30], [*lines[:30], b"1 2 three", *lines[31:]], [*lines[:30], b"1 2", *lines[31:]]):
        with pytest.raises(ScanError, match=r"a\.ply"):
            load(tmp_path, header + b"\n".join(broken))
    with pytest.raises(ScanError, match=r"promises .* copy or export"):
        load(tmp_path, header.replace(b"vertex 40", b"vertex " + MANY) + b"\n".join(lines))


def test_gaussian_splats_are_refused_with_a_remedy(tmp_path: Path) -> None:
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "opacity", "scale_0", "rot_0"))
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex 4\n{names}end_header\n"
    (tmp_path / "a.ply").write_bytes(header.encode() + bytes(4 * 6 * 4))
    with pytest.raises(ScanError, match="splats are no surface points; export"):
        load_points(tmp_path / "a.ply")
