""".las and .laz files, written by laspy: colors, units, noise, and headers that lie."""

import gzip
import io
import struct
from pathlib import Path

import numpy as np
import pytest
from damage import draw_damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_cloud, load_points
from reconstruction._src.scans.ground import find_heights_above_ground

laspy = pytest.importorskip("laspy", reason="the extra `formats` is not installed")
from laspy.vlrs.known import GeoKeyDirectoryVlr, GeoKeyEntryStruct, WktCoordinateSystemVlr  # noqa: E402

POINTS = np.round(np.random.default_rng(0).uniform(0, 10, (40, 3)), 3)
COLORS = np.random.default_rng(1).integers(0, 256, (40, 3)).astype(np.uint16)
FEET = 'PROJCS["x",GEOGCS["y",UNIT["degree",0.0174532925199433]],UNIT["US survey foot",0.304800609601219]]'
MIXED = f'COMPD_CS["x",{FEET.replace("0.304800609601219", "1.0")},VERT_CS["h",UNIT["foot",0.3048]]]'


def las(
    points: np.ndarray = POINTS,
    version: str = "1.2",
    point_format: int = 2,
    packed: bool = False,
    vlrs: tuple = (),
    **fields: np.ndarray,
) -> bytes:
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.floor(points.min(axis=0))
    header.vlrs.extend(vlrs)
    data = laspy.LasData(header)
    data.xyz = points
    for name, values in fields.items():
        data[name] = values
    file = io.BytesIO()
    data.write(file, do_compress=packed)
    return file.getvalue()


def geo_keys(**values: int) -> GeoKeyDirectoryVlr:
    record = GeoKeyDirectoryVlr()
    for key, value in values.items():
        entry = GeoKeyEntryStruct()
        entry.id, entry.tiff_tag_location, entry.count, entry.value_offset = int(key[1:]), 0, 1, value
        record.geo_keys.append(entry)
    record.geo_keys_header.number_of_keys = len(record.geo_keys)
    return record


def colored(factor: int = 257) -> dict[str, np.ndarray]:
    return dict(zip(("red", "green", "blue"), (COLORS * factor).T, strict=True))


def write(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(("version", "point_format"), [("1.2", 2), ("1.4", 7)])
@pytest.mark.parametrize("factor", [257, 1])  # 16 bits, and the 8 bits that many writers leave
def test_points_and_colors(
    tmp_path: Path, packed: bool, version: str, point_format: int, factor: int
) -> None:
    name = "a.laz" if packed else "a.las"
    content = las(version=version, point_format=point_format, packed=packed, **colored(factor))
    cloud = load_cloud(write(tmp_path, name, content))
    np.testing.assert_allclose(cloud.points, POINTS, atol=1e-9)
    np.testing.assert_array_equal(cloud.colors, COLORS)
    assert cloud.viewpoints is None
    packed_again = load_cloud(write(tmp_path, f"{name}.gz", gzip.compress(content)))
    np.testing.assert_array_equal(packed_again.points, cloud.points)


def test_a_file_without_colors(tmp_path: Path) -> None:
    for point_format in (1, 2):  # no room for colors; and room, all zero
        assert load_cloud(write(tmp_path, "a.las", las(point_format=point_format))).colors is None


@pytest.mark.parametrize("is_on_map", [True, False])
def test_only_on_a_map_the_file_says_that_z_points_up(tmp_path: Path, caplog, is_on_map: bool) -> None:
    rng = np.random.default_rng(5)
    ground, trees = (rng.uniform([-60, 0, -60], [60, high, 60], (900, 3)) for high in (0.2, 9.0))
    records = (geo_keys(k3076=9001),) if is_on_map else ()
    cloud = load_cloud(write(tmp_path, "a.las", las(np.concatenate([ground, trees]), vlrs=records)))
    assert cloud.up == ("z" if is_on_map else "y")
    assert ("y is taken for up" in caplog.text) == (not is_on_map)


def test_noise_and_withheld_points_are_dropped_and_counted(tmp_path: Path, caplog) -> None:
    kinds, withheld = np.zeros(40, np.uint8), np.zeros(40, np.uint8)
    kinds[[3, 4]], withheld[9] = (7, 18), 1
    cloud = load_cloud(write(tmp_path, "a.las", las(classification=kinds, withheld=withheld, **colored())))
    np.testing.assert_allclose(cloud.points, np.delete(POINTS, [3, 4, 9], axis=0), atol=1e-9)
    np.testing.assert_array_equal(cloud.colors, np.delete(COLORS, [3, 4, 9], axis=0))
    assert "dropped 3 rows" in caplog.text


def test_classes_that_a_robot_meets_are_read_or_those_that_are_named(tmp_path: Path) -> None:
    kinds = np.repeat([1, 2, 5, 6, 9, 14, 3, 4], 5).astype(np.uint8)
    path = write(tmp_path, "a.las", las(classification=kinds))
    met = np.isin(kinds, (1, 2, 6, 3, 4))
    np.testing.assert_allclose(load_cloud(path).points, POINTS[met], atol=1e-3)
    np.testing.assert_allclose(
        load_cloud(path, classes=(2, 9)).points, POINTS[np.isin(kinds, (2, 9))], atol=1e-3
    )
    with pytest.raises(ScanError, match=r"only \.las and \.laz"):
        load_cloud(write(tmp_path, "a.xyz", b"0 0 0\n1 0 0\n0 1 0\n"), classes=(2,))


@pytest.mark.parametrize(
    ("record", "factors"),
    [
        (geo_keys(k1024=1, k3076=9002), [0.3048, 0.3048]),
        (geo_keys(k3076=9003), [1200 / 3937] * 2),
        (geo_keys(k3076=9001, k4099=9002), [1.0, 0.3048]),
        (WktCoordinateSystemVlr(FEET), [0.304800609601219] * 2),
        (WktCoordinateSystemVlr(MIXED), [1.0, 0.3048]),
    ],
)
def test_the_unit_is_that_of_the_coordinate_system(
    tmp_path: Path, record: object, factors: list[float]
) -> None:
    path = write(tmp_path, "a.las", las(vlrs=(record,)))
    factor = np.array([factors[0], factors[0], factors[1]])
    np.testing.assert_allclose(load_cloud(path).points, POINTS * factor, atol=1e-9)
    np.testing.assert_allclose(load_points(path, "cm"), POINTS * factor / factors[0] / 100, atol=1e-9)


@pytest.mark.parametrize("record", [geo_keys(k1024=2), WktCoordinateSystemVlr('GEOGCS["WGS 84"]')])
def test_degrees_are_refused_with_the_remedy(tmp_path: Path, record: object) -> None:
    with pytest.raises(ScanError, match=r"a\.las: .*degrees.*reprojection"):
        load_cloud(write(tmp_path, "a.las", las(vlrs=(record,))))


def test_a_header_that_promises_too_much_is_refused(tmp_path: Path) -> None:
    for name, packed in (("a.las", False), ("a.laz", True)):
        lying = bytearray(las(packed=packed))
        lying[107:111] = struct.pack("<I", 70_000_000)  # the number of points in LAS 1.2
        path = write(tmp_path, name, bytes(lying))
        with pytest.raises(ScanError, match=rf"{name}: "):
            load_cloud(path)
        with pytest.raises(ScanError, match=r"limit of .*max_bytes="):
            load_cloud(path, max_bytes=1e8)


@pytest.mark.parametrize(
    ("version", "place", "form", "value", "reason"),
    [
        ("1.2", 0, "4s", b"LASX", "does not begin"),
        ("1.2", 100, "<I", 4_000_000_000, "promises records of"),
        ("1.4", 243, "<I", 4_000_000_000, "promises extended records of"),
        ("1.2", None, "<q", 10**12, "outside the file"),
    ],
)
def test_counts_that_cannot_be_true_are_refused_at_once(
    tmp_path: Path, version: str, place: int | None, form: str, value: object, reason: str
) -> None:
    content = bytearray(las(version=version, point_format=2 if version == "1.2" else 7, packed=True))
    points_at = struct.unpack_from("<I", content, 96)[0]
    struct.pack_into(form, content, points_at if place is None else place, value)
    with pytest.raises(ScanError, match=reason):
        load_cloud(write(tmp_path, "a.laz", bytes(content)))


def test_a_table_of_too_many_chunks_is_refused(tmp_path: Path) -> None:
    """Its reader would reserve 16 bytes for each, and end the process."""
    content = bytearray(las(packed=True))
    (table_at,) = struct.unpack_from("<q", content, struct.unpack_from("<I", content, 96)[0])
    struct.pack_into("<I", content, table_at + 4, 4_000_000_000)
    with pytest.raises(ScanError, match=r"promises chunks of 4000000000 bytes.* damaged .*copy or export"):
        load_cloud(write(tmp_path, "a.laz", bytes(content)))


@pytest.mark.parametrize("packed", [False, True])
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_give_points_or_the_error(tmp_path: Path, packed: bool, data: st.DataObject) -> None:
    content = draw_damaged(data, las(packed=packed, **colored()))
    try:
        cloud = load_cloud(write(tmp_path, "a.laz" if packed else "a.las", content), max_bytes=1e6)
    except ScanError:
        return
    assert np.isfinite(cloud.points).all()


def make_forest() -> tuple[np.ndarray, np.ndarray]:
    """Return points of a slope with trees and a house, and what each belongs to: ground, trunk, crown, roof."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0.0, 80.0, (60_000, 2)), np.zeros(60_000)])
    ground = 5.0 * np.sin(points[:, 0] / 20.0) + 0.3 * points[:, 1]
    points[:, 2] = ground + rng.normal(0.0, 0.03, len(points))
    kind = np.full(len(points), "ground")
    distance, _ = cKDTree(rng.uniform(0.0, 80.0, (100, 2))).query(points[:, :2])
    for name, chosen, low, high in (
        ("crown", (distance < 3.0) & (rng.random(len(points)) < 0.8), 4.0, 12.0),
        ("trunk", distance < 0.3, 0.2, 1.5),
    ):
        points[chosen, 2] = (ground + rng.uniform(low, high, len(points)))[chosen]
        kind[chosen] = name
    is_roof = (np.abs(points[:, :2] - [40.0, 40.0]) < [8.0, 5.0]).all(axis=1)
    points[is_roof, 2], kind[is_roof] = 30.0, "roof"
    return points, kind


def test_of_a_forest_without_classes_the_ground_and_the_trunks_stay(tmp_path: Path) -> None:
    points, kind = make_forest()
    twice = np.full(len(points), 2)
    path = write(tmp_path, "a.las", las(points, number_of_returns=twice))
    kept = cKDTree(load_cloud(path).points).query(points)[0] < 0.002
    assert kept[kind == "ground"].mean() > 0.98
    assert kept[kind == "trunk"].mean() > 0.98
    assert kept[kind == "crown"].mean() < 0.02
    assert not kept[kind == "roof"].any()
    # as the caller wants, or the file says
    assert load_cloud(path, classes=(0, 1)).num_points == len(points)
    with pytest.raises(ScanError, match="no point is of class 2, 6"):
        load_cloud(path, classes=(2, 6))
    classes = np.where(kind == "ground", 2, 1)
    path = write(tmp_path, "b.las", las(points, classification=classes, number_of_returns=twice))
    assert load_cloud(path).num_points == len(points)
    assert load_cloud(write(tmp_path, "c.las", las(points))).num_points == len(points)


def test_a_point_far_below_the_ground_and_a_narrow_scan_do_not_mislead(tmp_path: Path) -> None:
    points, kind = make_forest()
    points[::7000, 2] -= 30.0
    heights = find_heights_above_ground(points)
    assert (np.abs(heights[kind == "ground"]) < 2.0).mean() > 0.98
    np.testing.assert_allclose(find_heights_above_ground(points[:1]), 0.0)
    line = np.column_stack([np.linspace(0.0, 1e7, 50), np.zeros((50, 2))])
    np.testing.assert_allclose(find_heights_above_ground(line), 0.0)


@pytest.mark.data
def test_a_real_file(shared_data: Path) -> None:
    cloud = load_cloud(shared_data / "pdal_lone_star.laz")
    assert cloud.num_points == 518_862
    np.testing.assert_array_equal(cloud.offset, [515_393.0, 4_918_365, 2_327])
