"""Files as clouds: colors, positions of the sensor, the frame, large coordinates, and sizes that are asked about."""

import gzip
import logging
from pathlib import Path

import numpy as np
import pytest

import reconstruction as rc
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_cloud, make_log_cloud, recenter
from reconstruction._src.scans.frames import UP_AXES, RawPoints, describe_odd_size, find_offset, to_meters
from reconstruction._src.scans.scan import ScanLog

POINTS = np.array([[0.0, 0.25, 0.5], [1.0, 2.0, -3.0], [4.0, 5.5, 6.0], [-1.5, 0.125, 2.0], [8.0, 1.0, 0.75]])
COLORS = np.array([[0, 10, 255], [1, 2, 3], [200, 100, 50], [9, 8, 7], [255, 255, 255]], np.uint8)
PACKED = (COLORS.astype(np.uint32) << np.array([16, 8, 0], np.uint32)).sum(axis=1).astype(np.uint32)


def write(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def join_rows(points: np.ndarray, colors: np.ndarray, separator: str = " ") -> str:
    rows = zip(points, colors, strict=True)
    return "".join(separator.join([*map(repr, map(float, p)), *map(str, c)]) + "\n" for p, c in rows)


def ply(body: bytes, kind: str, form: str = "ascii") -> bytes:
    names = "".join(f"property float {name}\n" for name in "xyz")
    names += "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    return f"ply\nformat {form} 1.0\nelement vertex 5\n{names}end_header\n".encode() + body


def pcd(
    kind: str, data: str, body: bytes, viewpoint: str = "0 0 0 1 0 0 0", height: int = 1, name: str = "rgb"
) -> bytes:
    width = 5 // height
    return (
        f"VERSION .7\nFIELDS x y z {name}\nSIZE 4 4 4 4\nTYPE F F F {kind}\nCOUNT 1 1 1 1\nWIDTH {width}\n"
        f"HEIGHT {height}\nVIEWPOINT {viewpoint}\nPOINTS 5\nDATA {data}\n"
    ).encode() + body


def records(kind: str, colors: np.ndarray) -> bytes:
    dtype = np.dtype([("xyz", "<f4", 3), ("rgb", kind, 3)])
    rows = np.zeros(5, dtype)
    rows["xyz"], rows["rgb"] = POINTS, colors
    return rows.tobytes()


PACKED_RECORDS = np.rec.fromarrays([*POINTS.astype("<f4").T, PACKED.astype("<u4")]).tobytes()
COLORED = {
    "ascii.ply": ply(join_rows(POINTS, COLORS).encode(), "uchar"),
    "binary.ply": ply(records("u1", COLORS), "uchar", "binary_little_endian"),
    "short.ply": ply(records("<u2", COLORS.astype(np.uint16) * 257), "ushort", "binary_little_endian"),
    "float.ply": ply(records("<f4", COLORS / 255), "float", "binary_little_endian"),
    "float.pcd": pcd("F", "binary", PACKED_RECORDS),
    "rgba.pcd": pcd("U", "binary", PACKED_RECORDS, name="rgba"),
    "text.pcd": pcd("U", "ascii", join_rows(POINTS, PACKED[:, None]).encode()),
    "text_float.pcd": pcd("F", "ASCII", join_rows(POINTS, PACKED[:, None].view(np.float32)).encode()),
    "names.csv": "X,Y,Z,R,G,B\n" + join_rows(POINTS, COLORS, ","),
    "long_names.csv": "z,y,x,red,green,blue\n" + join_rows(POINTS[:, ::-1], COLORS, ","),
    "six.xyz": join_rows(POINTS, COLORS),
    "seven.txt": join_rows(np.c_[POINTS, np.full(5, 0.5)], COLORS),
    "a.pts": "5\n" + join_rows(np.c_[POINTS, np.full(5, -130)], COLORS),
    "a.obj": "".join(f"v {line}\n" for line in join_rows(POINTS, COLORS / 255).splitlines()),
}


@pytest.mark.parametrize("name", COLORED)
def test_colors_are_kept(tmp_path: Path, name: str) -> None:
    cloud = load_cloud(write(tmp_path, name, COLORED[name]))
    np.testing.assert_allclose(cloud.points, POINTS, atol=1e-6)
    np.testing.assert_array_equal(cloud.colors, COLORS)
    np.testing.assert_array_equal(rc.load_points(tmp_path / name), cloud.points)


@pytest.mark.parametrize(
    "columns",
    [
        np.full((5, 3), 0.5),  # normals
        np.c_[COLORS[:, :2], np.full(5, 256)],
        np.c_[COLORS[:, :2], np.full(5, -1)],
        np.zeros((5, 3), int),
        np.ones((5, 2), int),  # five columns
    ],
)
def test_columns_that_need_not_be_colors_are_none(tmp_path: Path, columns: np.ndarray) -> None:
    cloud = load_cloud(write(tmp_path, "a.xyz", join_rows(POINTS, columns)))
    assert cloud.colors is None
    assert cloud.num_points == 5


def make_log() -> ScanLog:
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = [0.0, 0.5, 0.5]
    ranges = np.array([[1.0, 2.0], [np.nan, 3.0], [1.5, 2.5]])
    return ScanLog(ranges, np.array([0.0, 1.0]), poses)


def test_a_log_tells_where_each_point_was_seen_from(tmp_path: Path) -> None:
    log = make_log()
    for cloud in (make_log_cloud(log), load_cloud(log.save(tmp_path / "a.npz"))):
        np.testing.assert_array_equal(cloud.points, log.points())
        np.testing.assert_array_equal(cloud.viewpoints, [[0.0, 0, 0], [0.5, 0, 0]])
        np.testing.assert_array_equal(cloud.seen_from, [0, 0, 1, 1, 1])
        ranges = np.linalg.norm(cloud.points - cloud.origins, axis=1)
        np.testing.assert_allclose(ranges, log.ranges[log.is_valid])


def test_arrays_of_an_npz_go_with_its_points(tmp_path: Path) -> None:
    viewpoints, seen_from = np.array([[0.0, 0, 1], [5, 0, 1]]), np.array([0, 1, 1, 0, 0])
    np.savez(tmp_path / "a.npz", points=POINTS, colors=COLORS, viewpoints=viewpoints, seen_from=seen_from)
    cloud = load_cloud(tmp_path / "a.npz", unit="cm", up="y")
    np.testing.assert_array_equal(cloud.colors, COLORS)
    np.testing.assert_array_equal(cloud.seen_from, seen_from)
    np.testing.assert_allclose(cloud.viewpoints, [[0, -0.01, 0], [0.05, -0.01, 0]])
    np.testing.assert_allclose(cloud.points, POINTS[:, [0, 2, 1]] * [0.01, -0.01, 0.01])
    np.savez(tmp_path / "bad.npz", points=POINTS, viewpoints=viewpoints, seen_from=seen_from + 1)
    with pytest.raises(ScanError, match=r"bad\.npz: seen_from has the indices 1 to 2"):
        load_cloud(tmp_path / "bad.npz")


def make_sweeps() -> np.ndarray:
    """Two sweeps of nine beams, in the frame and unit of 3DTK."""
    angle, distance = np.linspace(0, np.pi, 9), 100.0 + 10 * np.arange(9)
    ahead = distance * np.sin(angle)
    return np.concatenate(
        [np.c_[distance * np.cos(angle), ahead * np.sin(t), ahead * np.cos(t)] for t in (-0.1, 0.2)]
    )


SWEEPS = make_sweeps()


@pytest.mark.parametrize("ordered", [True, False])
def test_a_3dtk_scan_stands_where_its_pose_says(tmp_path: Path, ordered: bool) -> None:
    rows = SWEEPS if ordered else SWEEPS[[0, 9, 1, 10, 2]]
    path = write(tmp_path, "scan000.3d", "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in rows.tolist()))
    write(tmp_path, "scan000.pose", "500 100 0\n0 0 0\n")
    cloud = load_cloud(path, unit="mm")  # 3DTK has centimeters only
    np.testing.assert_allclose(cloud.viewpoints, [[0, -5.0, 1.0]])
    expected = np.stack([rows[:, 2], -rows[:, 0], rows[:, 1]], axis=1) / 100 + [0, -5.0, 1.0]
    np.testing.assert_allclose(cloud.points, expected, atol=1e-9)


def test_a_3dtk_scan_without_pose_is_seen_from_its_origin(tmp_path: Path) -> None:
    cloud = load_cloud(write(tmp_path, "a.3d", "".join(f"{x} {y} {z}\n" for x, y, z in SWEEPS)))
    np.testing.assert_array_equal(cloud.viewpoints, np.zeros((1, 3)))


DEFAULT = "0 0 0 1 0 0 0"
GRID = np.random.default_rng(0).uniform([-2, -1, 1], [2, 1, 4], (24, 3))


def write_grid(folder: Path, viewpoint: str, height: int = 1, shift: float = 0.0) -> Path:
    head = (
        f"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {24 // height}\nHEIGHT {height}\n"
        f"VIEWPOINT {viewpoint}\nPOINTS 24\nDATA binary\n"
    )
    return write(folder, "a.pcd", head.encode() + (GRID + shift).astype("<f4").tobytes())


@pytest.mark.parametrize(
    ("viewpoint", "height", "shift", "expected"),
    [
        ("1 2 3 1 0 0 0", 1, 0.0, [1.0, 2.0, 3.0]),
        ("0 0 0 0 1 0 0", 4, 0.0, [0.0, 0.0, 0.0]),
        (DEFAULT, 4, 0.0, None),  # what writers put where nobody knows
    ],
)
def test_the_viewpoint_of_a_pcd_file_is_believed_unless_it_is_the_default(
    tmp_path: Path, viewpoint: str, height: int, shift: float, expected: list[float] | None
) -> None:
    cloud = load_cloud(write_grid(tmp_path, viewpoint, height, shift))
    np.testing.assert_allclose(cloud.points, GRID + shift, atol=1e-5)  # VIEWPOINT moves no points
    assert (None if cloud.viewpoints is None else cloud.viewpoints[0].tolist()) == expected


@pytest.mark.parametrize("viewpoint", ["0 0 0", "a b c d e f g", "nan 0 0 1 0 0 0"])
def test_a_broken_viewpoint_is_refused(tmp_path: Path, viewpoint: str) -> None:
    with pytest.raises(ScanError, match=r"a\.pcd: VIEWPOINT"):
        load_cloud(write_grid(tmp_path, viewpoint))


def test_given_viewpoints_replace_those_of_the_file_and_move_with_the_points(tmp_path: Path) -> None:
    far = POINTS + np.array([500_000.25, 5_000_000.0, 300.0])
    path = tmp_path / "a.npz"
    np.savez(path, points=far, viewpoints=far[:1])
    cloud = load_cloud(path, viewpoints=[[500_001.0, 5_000_000.0, 302.0], [500_002.0, 5_000_000.0, 302.0]])
    np.testing.assert_array_equal(cloud.offset, [500_001.0, 5_000_001.0, 301.0])
    np.testing.assert_allclose(cloud.points + cloud.offset, far, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(cloud.viewpoints, [[0, -1, 1], [1, -1, 1]])
    assert cloud.seen_from is None
    np.testing.assert_array_equal(load_cloud(path, viewpoints=[0, 0, 1]).seen_from, np.zeros(5))
    again = recenter(cloud)
    assert again is cloud


@pytest.mark.parametrize("viewpoints", [[1, 2], "abc", [[np.nan, 0, 0]], np.zeros((0, 3))])
def test_what_is_no_viewpoint_is_refused(tmp_path: Path, viewpoints: object) -> None:
    path = write(tmp_path, "a.xyz", join_rows(POINTS, COLORS))
    with pytest.raises(ScanError, match=r"a\.xyz: viewpoints"):
        load_cloud(path, viewpoints=viewpoints)


def test_rows_that_are_not_finite_take_their_colors_with_them(tmp_path: Path, caplog) -> None:
    text = join_rows(POINTS, COLORS) + "nan 0 0 4 5 6\n1 inf 2 4 5 6\n" + "7 7 7 7 7 8\n"
    cloud = load_cloud(write(tmp_path, "a.xyz.gz", gzip.compress(text.encode())))
    np.testing.assert_array_equal(cloud.colors, [*COLORS, [7, 7, 8]])
    assert "dropped 2 rows" in caplog.text


def test_beams_without_return_are_no_points(tmp_path: Path) -> None:
    with pytest.raises(ScanError, match=r"z\.xyz: 0 of 4 points .* 3 are needed"):
        load_cloud(write(tmp_path, "z.xyz", "0 0 0\n" * 4))


def test_a_size_of_no_scene_is_warned_about(tmp_path: Path, caplog) -> None:
    path = write(tmp_path, "a.xyz", join_rows(POINTS * 1000, COLORS))
    with caplog.at_level(logging.WARNING):
        load_cloud(path, unit="mm")
        assert not caplog.text
        load_cloud(path)
    assert "a.xyz: its longest side is 9,500 m, above 1000 m; if that is wrong, give unit= or" in caplog.text


@pytest.mark.parametrize(("name", "remedy"), [("a.db3", "ros2 bag convert"), ("a.FBX", "Blender")])
def test_files_that_are_not_read_name_the_tool_that_converts_them(
    tmp_path: Path, name: str, remedy: str
) -> None:
    path = write(tmp_path, name, b"whatever")
    for load in (load_cloud, rc.load_points, rc.load_mesh):
        with pytest.raises(ScanError, match=rf"{name}: .*{remedy}"):
            load(path)


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "count", "viewpoint", "offset"),
    [
        ("3dtk_scan000.3d", 77_976, [0.0, 0, 0], [0.0, 0, 0]),
        ("pcl_depth_camera_room.pcd", 249_647, [0.0, 0, 0], [0.0, 0, 0]),
        ("pcl_aerial_samp11_utm.pcd", 38_010, None, [512_767.0, 5_403_706, 357]),
    ],
)
def test_real_clouds(shared_data: Path, name: str, count: int, viewpoint: list | None, offset: list) -> None:
    cloud = load_cloud(shared_data / name)
    assert (cloud.num_points, cloud.offset.tolist()) == (count, offset)
    assert (None if cloud.viewpoints is None else cloud.viewpoints[0].tolist()) == viewpoint


TWO = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, -6.0]])
AXES = {name: np.eye(3)["xyz".index(name[-1])] * (-1 if name[0] == "-" else 1) for name in UP_AXES}


@pytest.mark.parametrize("up", UP_AXES)
def test_the_axis_that_is_up_becomes_z_by_a_rotation(up: str) -> None:
    assert np.linalg.det(UP_AXES[up]) == 1
    np.testing.assert_array_equal(to_meters(AXES[up][None], RawPoints(TWO), up=up), [[0, 0, 1]])
    np.testing.assert_array_equal(to_meters(TWO, RawPoints(TWO), up=up), TWO @ np.transpose(UP_AXES[up]))


def test_units_and_scale_multiply() -> None:
    for unit, meters in (("us-ft", 1200 / 3937), ("in", 0.0254), ("mm", 0.001)):
        placed = to_meters(TWO, RawPoints(TWO), unit, scale=2.0)
        np.testing.assert_allclose(placed, TWO * meters * 2)


def test_the_caller_decides_before_the_file_and_the_file_before_the_default() -> None:
    raw = RawPoints(TWO, meters=0.01, up="y")
    np.testing.assert_allclose(to_meters(TWO, raw), TWO @ np.transpose(UP_AXES["y"]) * 0.01)
    np.testing.assert_allclose(to_meters(TWO, raw, "ft", "z"), TWO * 0.3048)
    fixed = raw._replace(has_fixed_unit=True, up=None)
    np.testing.assert_allclose(to_meters(TWO, fixed, "ft"), TWO * 0.01)
    assert to_meters(TWO, RawPoints(TWO)) is TWO


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"unit": "inch"}, "'inch'; there are: m, cm, mm, ft"),
        ({"up": "down"}, "'down'; there are: z, -z"),
        ({"scale": 0.0}, "scale must be above 0"),
        ({"scale": np.nan}, "scale must be above 0"),
    ],
)
def test_what_is_no_frame_is_refused(values: dict, reason: str) -> None:
    with pytest.raises(ScanError, match=reason):
        to_meters(TWO, RawPoints(TWO), **values)


def sheet(extent: float, center: tuple[float, float, float]) -> np.ndarray:
    points = np.random.default_rng(0).uniform(-extent / 2, extent / 2, (500, 3)) + np.array(center)
    points[0] += 2 * extent  # the middle is the median
    return points


@pytest.mark.parametrize(
    ("extent", "center", "is_far"),
    [
        (300.0, (512_767.3, 5_403_706.8, 357.0), True),
        (10.0, (900.0, 0.0, 0.0), False),
        (10.0, (1100.0, 0.0, 0.0), True),
        (3000.0, (1500.0, 0.0, 0.0), False),  # the origin is at its rim
        (0.05, (200.0, 0.0, 0.0), True),
        (4.0, (0.0, 0.0, 0.0), False),
    ],
)
def test_large_coordinates_are_moved_by_whole_meters(extent: float, center: tuple, is_far: bool) -> None:
    points = sheet(extent, center)
    offset = find_offset(points)
    assert offset.any() == is_far
    np.testing.assert_array_equal(offset, np.round(offset))
    if is_far:
        assert np.abs(np.median(points - offset, axis=0)).max() <= 0.5
        rounded = (points - offset).astype(np.float32)
        assert np.abs(rounded - (points - offset)).max() <= 1e-6 * extent


@pytest.mark.parametrize(("step", "is_told"), [(0.1, True), (0.01, False)])
def test_a_voxel_map_says_what_it_does_not_tell(tmp_path: Path, caplog, step: float, is_told: bool) -> None:
    places = np.random.default_rng(0).uniform(0.0, [3.0, 3.0, 0.5], (4000, 3))
    np.savetxt(tmp_path / "map.xyz", step * np.round(places / step))
    load_cloud(tmp_path / "map.xyz")
    assert (f"stand on a grid of {1000 * step:g} mm" in caplog.text) == is_told


def test_odd_sizes_are_described_and_others_are_not() -> None:
    for extent in (0.11, 5.0, 990.0):
        assert describe_odd_size(np.array([[0.0, 0, 0], [extent, 0, 0]])) is None
    assert (
        describe_odd_size(np.array([[0.0, 0, 0], [0, 2700.0, 0]]))
        == "its longest side is 2,700 m, above 1000 m"
    )
    assert (
        describe_odd_size(np.array([[0.0, 0, 0], [0.02, 0, 0]])) == "its longest side is 20 mm, below 10 cm"
    )


def test_rows_of_floats_are_read_by_what_fits_and_other_bytes_refused(tmp_path: Path, caplog) -> None:
    rng = np.random.default_rng(0)
    rows = rng.uniform(-50, 50, (60, 4)).astype("<f4")
    rows[:, 3] = rng.uniform(0, 1, 60)
    rings = np.column_stack([rows, rng.integers(0, 32, 60)]).astype("<f4")
    (tmp_path / "1.bin").write_bytes(rings.tobytes())
    np.testing.assert_array_equal(load_cloud(tmp_path / "1.bin").points, rings[:, :3])
    colors = rng.integers(0, 256, (60, 3))
    for scale in (1, 255):
        colored = np.column_stack([rows[:, :3], colors / scale]).astype("<f4")
        (tmp_path / "2.bin").write_bytes(colored.tobytes())
        cloud = load_cloud(tmp_path / "2.bin")
        np.testing.assert_array_equal(cloud.points, colored[:, :3])
        np.testing.assert_array_equal(cloud.colors, colors)
        assert cloud.viewpoints is None
    positive = np.abs(rows)  # 240 numbers: rows of four, of five or of six
    (tmp_path / "3.bin").write_bytes(positive.tobytes())
    np.testing.assert_array_equal(load_cloud(tmp_path / "3.bin").points, positive[:, :3])
    rows[:3] = 0.0
    (tmp_path / "0.bin").write_bytes(rows.tobytes())
    cloud = load_cloud(tmp_path / "0.bin")
    np.testing.assert_array_equal(cloud.points, rows[3:, :3])
    assert "dropped 3 beams without return" in caplog.text
    for content in (rows.tobytes() + b"x", (rows * 1e5).tobytes(), np.full(8, np.nan, "<f4").tobytes()):
        (tmp_path / "0.bin").write_bytes(content)
        with pytest.raises(ScanError, match="CloudCompare"):
            load_cloud(tmp_path / "0.bin")
