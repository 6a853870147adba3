""".e57 files, written by pye57: poses, colors, invalid points, and broken files."""

import struct
from pathlib import Path

import numpy as np
import pytest
from damage import draw_damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_cloud, load_points
from reconstruction._src.scans.survey_files import to_cartesian

pye57 = pytest.importorskip("pye57", reason="the extra `formats` is not installed")

LOCAL = np.random.default_rng(0).uniform([-3, -2, -1], [3, 2, 2], (60, 3)).astype(np.float32).astype(float)
COLORS = np.random.default_rng(1).integers(0, 256, (60, 3))
TURN = np.array([np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)])  # a quarter turn about z
IDENTITY = np.array([1.0, 0, 0, 0])


def columns(points: np.ndarray = LOCAL, colors: np.ndarray | None = None, **more: np.ndarray) -> dict:
    data = {f"cartesian{axis}": points[:, k].copy() for k, axis in enumerate("XYZ")}
    if colors is not None:
        data |= {f"color{name}": colors[:, k].copy() for k, name in enumerate(("Red", "Green", "Blue"))}
    return data | more


def write(path: Path, *scans: tuple[dict, np.ndarray | None, np.ndarray | None]) -> Path:
    file = pye57.E57(str(path), "w")
    for data, rotation, translation in scans:
        file.write_scan_raw(data, rotation=rotation, translation=translation)
    file.close()
    return path


def test_scans_stand_in_the_common_frame_and_know_their_sensor(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.e57",
        (columns(colors=COLORS), TURN, np.array([10.0, 0, 1.5])),
        (columns(LOCAL[:20], COLORS[:20]), IDENTITY, np.array([4.0, 1, 1.5])),
    )
    cloud = load_cloud(path)
    turned = np.stack([10.0 - LOCAL[:, 1], LOCAL[:, 0], LOCAL[:, 2] + 1.5], axis=1)
    moved = LOCAL[:20] + np.array([4.0, 1, 1.5])
    np.testing.assert_allclose(cloud.points, np.concatenate([turned, moved]), atol=1e-6)
    np.testing.assert_array_equal(cloud.colors, np.concatenate([COLORS, COLORS[:20]]))
    np.testing.assert_allclose(cloud.viewpoints, [[10.0, 0, 1.5], [4.0, 1, 1.5]])
    np.testing.assert_array_equal(cloud.seen_from, np.repeat([0, 1], [60, 20]))
    np.testing.assert_array_equal(load_points(path), cloud.points)


def test_points_without_a_reading_are_dropped_and_counted(tmp_path: Path, caplog) -> None:
    state = np.zeros(60, np.int8)
    state[[3, 7]] = 1, 2
    path = write(tmp_path / "a.e57", (columns(colors=COLORS, cartesianInvalidState=state), TURN, np.ones(3)))
    cloud = load_cloud(path)
    np.testing.assert_array_equal(cloud.colors, np.delete(COLORS, [3, 7], axis=0))
    np.testing.assert_array_equal(cloud.seen_from, np.zeros(58))
    assert "dropped 2 rows" in caplog.text


def test_an_identity_is_believed_of_one_scan_among_others_that_have_a_pose(tmp_path: Path) -> None:
    unknown, known = (columns(), IDENTITY, np.zeros(3)), (columns(), TURN, np.ones(3))
    for scans, viewpoints in (
        ([unknown], None),  # a merged cloud, or one in the scanner's frame: its readings tell
        ([unknown] * 2, None),  # two cannot both stand there
        ([unknown, known], [[0.0, 0, 0], [1.0, 1, 1]]),
        ([unknown, unknown, known], [[1.0, 1, 1]]),  # which point was seen from where is left open
    ):
        cloud = load_cloud(write(tmp_path / "a.e57", *scans))
        found = None if cloud.viewpoints is None else cloud.viewpoints.tolist()
        assert found == viewpoints


def test_what_cannot_be_used_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.e57", (columns(), TURN, np.ones(3)))
    content = path.read_bytes()
    for name, data in {
        "cut.e57": content[:-2000],
        "garbage.e57": b"ASTM-E57" + bytes(2000),
        "empty.e57": b"",
    }.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ScanError, match=name):
            load_cloud(tmp_path / name)
        assert (tmp_path / name).exists(), "pye57 removes what it cannot open for writing"
    with pytest.raises(ScanError, match="no scans"):
        load_cloud(write(tmp_path / "none.e57"))
    with pytest.raises(ScanError, match="limit"):
        load_cloud(path, max_bytes=1000)
    with pytest.raises(ScanError, match="pose"):
        load_cloud(write(tmp_path / "turned.e57", (columns(), TURN * 2, np.ones(3))))
    (tmp_path / "a.e57.gz").write_bytes(content)
    with pytest.raises(ScanError, match="unpack it first"):
        load_cloud(tmp_path / "a.e57.gz")
    with pytest.raises(ScanError, match="no such file"):
        load_cloud(tmp_path / "absent.e57")


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_give_points_or_the_error(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "a.e57"
    if not path.exists():
        write(path, (columns(colors=COLORS), TURN, np.ones(3)))
    (tmp_path / "b.e57").write_bytes(draw_damaged(data, path.read_bytes()))
    try:
        cloud = load_cloud(tmp_path / "b.e57", max_bytes=1e6)
    except ScanError:
        return
    assert np.isfinite(cloud.points).all()


def test_spherical_coordinates_are_those_of_the_standard() -> None:
    polar = np.array([[2.0, np.radians(30.0), np.radians(60.0)], [1.0, 0.0, 0.0], [1.0, np.pi / 2, 0.0]])
    expected = [[np.sqrt(3) / 2, 0.5, np.sqrt(3)], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    np.testing.assert_allclose(to_cartesian(polar.T).T, expected, atol=1e-12)


def test_xml_with_a_document_type_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    """It would name files and addresses, which the parser reads."""
    content = write(tmp_path / "a.e57", (columns(), TURN, np.ones(3))).read_bytes()
    declared = b'<?xml version="1.0" encoding="UTF-8"?>'
    begin = content.index(declared)
    end_of_page = (begin // 1024 + 1) * 1024
    split = content[: end_of_page - 8] + b"<!DO" + content[end_of_page - 4 : end_of_page] + b"CTYPE"
    for name, data in {
        "type.e57": content.replace(declared, b'<!DOCTYPE e57Root SYSTEM "/etc/x">'.ljust(len(declared))),
        "split.e57": split + content[len(split) :],
        "utf-7.e57": content.replace(b'"UTF-8"', b'"UTF-7"'),
        "ebcdic.e57": content.replace(declared, declared.decode().encode("cp037")),
        "short.e57": content[:40],
        "between.e57": content[:24] + struct.pack("<QQ", 1022, 100) + content[40:],
    }.items():
        (tmp_path / name).write_bytes(data)
        reasons = {"short.e57": "header of 48 bytes", "between.e57": "header names pages"}
        with pytest.raises(ScanError, match=reasons.get(name, "document type")):
            load_cloud(tmp_path / name)
