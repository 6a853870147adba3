"""Point files: what is read, what is written, and how every broken file is refused."""

import bz2
import gzip
import io
import struct
from pathlib import Path

import numpy as np
import pytest
from damage import draw_damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pypcd4.pypcd4 import Encoding, PointCloud

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_points, save_points
from reconstruction._src.scans.scan import load_scan_log

POINTS = np.array([[0.0, 0.25, 0.5], [1.0, 2.0, -3.0], [4.0, 5.5, 6.0], [-1.5, 0.125, 2.0], [8.0, 1.0, 0.75]])
TEXT = "\n".join(" ".join(map(str, row)) for row in POINTS) + "\n"


def pcd(encoding: str, points: np.ndarray = POINTS) -> bytes:
    file = io.BytesIO()
    cloud = PointCloud.from_xyz_points(points.astype(np.float32))
    cloud.save(file, Encoding(encoding))
    return file.getvalue()


def vtk(body: bytes, kind: str = "ASCII", count: str = "5", dtype: str = "float") -> bytes:
    head = f"# vtk DataFile Version 3.0\nmade by hand\n{kind}\nDATASET POLYDATA\nPOINTS {count} {dtype}\n"
    return head.encode() + body


def ply(body: bytes, count: int = 5, form: str = "ascii", names: str = "xyz") -> bytes:
    properties = "".join(f"property float {name}\n" for name in names)
    return f"ply\nformat {form} 1.0\nelement vertex {count}\n{properties}end_header\n".encode() + body


def npz(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def npy(array: np.ndarray, **options: bool) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


SINGLE = POINTS.astype("<f4").tobytes()
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS) + "vn 0 0 1\nf 1 2 3\n"
GOOD = {
    "a.xyz": TEXT.encode(),
    "a.txt": b"# a comment\n\n" + TEXT.replace(" ", "\t").encode(),
    "a.csv": b"\xef\xbb\xbfi,Y,X,z\n" + "".join(f"7,{y},{x},{z}\n" for x, y, z in POINTS).encode(),
    "semicolon.csv": TEXT.replace(" ", ";").encode(),
    "a.dat.bz2": bz2.compress(TEXT.encode()),
    "a.xyz.gz": gzip.compress(TEXT.encode()),
    "a.npy": npy(np.c_[POINTS, np.ones(5)].astype(np.float32)),
    "a.npz": npz(points=POINTS, other=np.ones(2)),
    "a.ply": ply(TEXT.encode()),
    "binary.ply": ply(SINGLE, form="binary_little_endian"),
    "big.ply": ply(POINTS.astype(">f4").tobytes(), form="binary_big_endian"),
    "a.pcd": pcd("ascii"),
    "binary.pcd": pcd("binary"),
    "compressed.pcd": pcd("binary_compressed"),
    "a.vtk": vtk(TEXT.encode()),
    "double.vtk": vtk(POINTS.astype(">f8").tobytes(), "BINARY", dtype="double"),
    "unsized.pcd": pcd("binary").replace(b"WIDTH 5", b"WIDTH 0"),
    "a.obj": OBJ.encode(),
    "a.ply.gz": gzip.compress(ply(SINGLE, form="binary_little_endian")),
}
GRID = b"ncols 3\nNROWS 2\nxllcorner 9.5\nyllcenter 20\ncellsize 1\nNODATA_value -9\n0 1 2 3\n-9 5"
PCD_HEAD = b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 5\nHEIGHT 1\n"
LYING = (b"POINTS 5", b"POINTS 500000000")
BROKEN = {
    "empty.xyz": b"",
    "empty.txt.gz": b"",
    "packed_nothing.txt.gz": gzip.compress(b""),
    "two.csv": b"x,y,z\n1,2,3\n4,5,6\n",
    "nan.xyz": b"nan nan nan\n" * 10,
    "words.xyz": b"1 2 3\n4 five 6\n7 8 9\n",
    "columns.xyz": b"1 2\n3 4\n5 6\n",
    "cut.xyz": TEXT.encode() + b"1.0 2",
    "garbage.xyz": bytes(range(256)) * 20,
    "latin.csv": b"x,y,z\n1,2,\xff\xfe\n" * 4,
    "cut.ply": ply(SINGLE, form="binary_little_endian")[:-9],
    "no_vertex.ply": ply(TEXT.encode()).replace(b"vertex", b"corner"),
    "list.npy": npy(np.arange(9.0)),
    "strings.npy": npy(np.array([["a", "b", "c"]] * 4)),
    "pickle.npy": npy(np.array([{}] * 4), allow_pickle=True),
    "cut.npy": npy(POINTS)[:-20],
    "several.npz": npz(a=POINTS, b=POINTS),
    "cut.npz": npz(points=POINTS)[:-40],
    "cut.pcd": pcd("binary")[:-11],
    "lies.pcd": pcd("binary").replace(*LYING),
    "lies_ascii.pcd": pcd("ascii").replace(b"WIDTH 5", b"WIDTH 7").replace(b"POINTS 5", b"POINTS 7"),
    "cut_compressed.pcd": pcd("binary_compressed")[:-5],
    "zeroed_compressed.pcd": pcd("binary_compressed")[:-20] + bytes(20),
    "words.pcd": PCD_HEAD + b"POINTS 5\nDATA ascii\n" + b"a b c\n" * 5,
    "type.pcd": pcd("binary").replace(b"TYPE F F F", b"TYPE F Q F"),
    "encoding.pcd": pcd("binary").replace(b"DATA binary", b"DATA morse"),
    "count.pcd": pcd("ascii").replace(b"COUNT 1 1 1", b"COUNT 1 1 1000000000"),
    "more_columns.pcd": pcd("ascii").replace(b"COUNT 1 1 1", b"COUNT 1 1 2"),
    "large_record.pcd": pcd("binary").replace(b"COUNT 1 1 1", b"COUNT 1 1 1000000000"),
    "several_z.pcd": pcd("binary").replace(b"COUNT 1 1 1", b"COUNT 1 1 2"),
    "long_line.xyz": b"1 " * 1_000_000,
    "cut.vtk": vtk(b"1 2 3 4 5"),
    "short.vtk": vtk(SINGLE[:30], "BINARY"),
    "huge.vtk": vtk(TEXT.encode(), count="99999999999"),
    "kind.vtk": vtk(TEXT.encode(), dtype="complex"),
    "no_points.vtk": b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n",
    "no_vertices.obj": b"# an empty scene\nf 1 2 3\n",
    "cut.obj": b"v 1 2 3\nv 4 5 6\nv 7 8\n",
    "cut.xyz.gz": gzip.compress(TEXT.encode())[:-9],
    "cut.xyz.bz2": bz2.compress(TEXT.encode())[:-9],
    "binary.3d": bytes(300),
    "cut.asc": GRID[:-2],
    "long.asc": GRID + b" 7",
    "words.asc": GRID.replace(b"5", b"five"),
    "lacking.asc": GRID.replace(b"yllcenter", b"south"),
    "zero.asc": GRID.replace(b"cellsize 1", b"cellsize 0"),
    "huge.asc": GRID.replace(b"ncols 3", b"ncols 3000000000"),
    "unknown.stp": TEXT.encode(),
    "no_suffix": TEXT.encode(),
}


def write(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", GOOD)
def test_every_format_gives_the_same_points_and_stops_at_the_limit(tmp_path, name):
    """Five points take 120 bytes."""
    path = write(tmp_path, name, GOOD[name])
    points = load_points(path, max_bytes=5000)
    assert points.dtype == np.float64
    np.testing.assert_allclose(points, POINTS, atol=1e-6)
    with pytest.raises(ScanError, match=r"limit .* max_bytes= .*--max-gigabytes") as error:
        load_points(path, max_bytes=100)
    assert str(error.value).startswith(f"{path}: ")


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_named_with_the_reason(tmp_path, name):
    path = write(tmp_path, name, BROKEN[name])
    with pytest.raises(ScanError) as error:
        load_points(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert len(message) >= len(f"{path}: is empty")


def test_the_values_of_a_grid_stand_over_the_middles_of_its_cells(tmp_path):
    expected = [[10, 21, 0], [11, 21, 1], [12, 21, 2], [10, 20, 3], [12, 20, 5]]
    assert load_points(write(tmp_path, "a.asc", GRID)).tolist() == expected


def test_absent_files_and_folders_are_refused(tmp_path):
    (tmp_path / "folder.ply").mkdir()
    for name, reason in (("absent.ply", "no such file"), ("folder.ply", "folder")):
        with pytest.raises(ScanError, match=reason):
            load_points(tmp_path / name)


@pytest.mark.parametrize("suffix", [".ply", ".xyz", ".txt", ".csv", ".npy", ".npz"])
def test_what_is_written_is_read(tmp_path, suffix):
    path = save_points(tmp_path / "new" / f"a{suffix}", POINTS)
    np.testing.assert_allclose(load_points(path), POINTS, atol=1e-8)
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_what_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(ScanError, match=r"\.stl"):
        save_points(tmp_path / "a.stl", POINTS)
    with pytest.raises(ScanError, match="shape"):
        save_points(tmp_path / "a.xyz", POINTS[:, :2])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.xyz", "a.ply", "binary.ply", "a.npy", "a.npz", "a.pcd", "binary.pcd"])
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_give_points_or_the_error(tmp_path, name, data):
    try:
        points = load_points(write(tmp_path, name, draw_damaged(data, GOOD[name])))
    except ScanError:
        return
    assert points.shape[1] == 3
    assert np.isfinite(points).all()


def make_3dtk() -> tuple[np.ndarray, str]:
    angle, distance = np.linspace(0, np.pi, 9), 100.0 + 10 * np.arange(9)
    ahead = distance * np.sin(angle)
    rows = [
        np.c_[distance * np.cos(angle), ahead * np.sin(t), ahead * np.cos(t)] for t in (-0.3, 0, 0.1, 0.3)
    ]
    points = np.concatenate(rows)
    return points, "\n".join(" ".join(f"{v:.6f}" for v in row) for row in points)


def test_a_raw_scan_of_3dtk_becomes_a_log(tmp_path):
    points, text = make_3dtk()
    path = write(tmp_path, "scan000.3d", text.encode())
    write(tmp_path, "scan000.pose", b"0 0 0\n0 0 0\n")
    log = load_scan_log(path)
    assert log.ranges.shape == (4, 9)
    expected = np.stack([points[:, 2], -points[:, 0], points[:, 1]], axis=1) / 100
    np.testing.assert_allclose(log.points(), expected, atol=1e-6)
    np.testing.assert_allclose(load_points(path), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "pose", "reason"),
    [
        ("1 2 3\n4 5 6\n7 8 9\n", "0 0 0 0 0 0", "not ordered"),
        (None, "0 0 0", "6 finite numbers"),
        (None, "0 0 0 a b c", "pose"),
        (None, None, "scan000"),
        ("", "0 0 0 0 0 0", "is empty"),
        (None, "0 " * 9000, "limit"),
    ],
)
def test_broken_raw_scans_are_refused(tmp_path, text, pose, reason):
    path = write(tmp_path, "scan000.3d", (make_3dtk()[1] if text is None else text).encode())
    if pose is not None:
        write(tmp_path, "scan000.pose", pose.encode())
    with pytest.raises(ScanError, match=reason):
        load_scan_log(path)


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("octomap_stairs_scan.dat.bz2", 88206),
        ("3dtk_scan000.3d", 81360),
        ("libpointmatcher_apartment_cloud_0.vtk", 36674),
        ("stanford-bunny.obj", 35947),
    ],
)
def test_real_files_are_read(shared_data, name, count):
    assert load_points(shared_data / name).shape == (count, 3)


def test_broken_numbers_are_reported_with_their_row(tmp_path):
    path = write(tmp_path, "a.xyz", b"1 2 3\n" * 60_000 + b"4 five 6\n")
    with pytest.raises(ScanError, match=r"row 60001 is not numbers: .*five"):
        load_points(path)


def test_the_lzf_header_is_checked_before_anything_is_allocated(tmp_path):
    data = pcd("binary_compressed")
    at = data.index(b"binary_compressed\n") + len(b"binary_compressed\n")
    lying = data[:at] + struct.pack("<II", 4, 2**32 - 1) + data[at + 8 :]
    with pytest.raises(ScanError, match="promises"):
        load_points(write(tmp_path, "a.pcd", lying))
