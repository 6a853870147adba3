"""Points are streamed into the files of their tiles, each once, and once for each halo that it lies in."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.scans import survey_files
from reconstruction._src.tiles import point_stream
from reconstruction._src.tiles.point_stream import (
    TilesConfig,
    fill_buckets,
    name_bucket,
    open_points,
    read_bucket,
)

CONFIG = TilesConfig(tile=10.0, halo=1.0)
FAR = np.array([5.4e6, 4.5e5, 300.0])


def test_points_by_hand(tmp_path):
    points = [[5, 5, 1], [9.5, 5, 2], [10.5, 10.5, 3], [-0.5, 5, 4], [25, 5, 5]]
    counts = fill_buckets(open_points(np.array(points, float)), tmp_path, CONFIG)
    assert counts == {(-1, 0): 1, (0, 0): 2, (1, 1): 1, (2, 0): 1}
    # Its two, that of the left neighbor and that of the diagonal one.
    heights = read_bucket(name_bucket(tmp_path, (0, 0)))
    assert sorted(heights[:, 2]) == [1, 2, 3, 4]
    # Relative to the corner of the tile.
    assert read_bucket(name_bucket(tmp_path, (2, 0))).tolist() == [[5, 5, 5]]


def test_every_point_is_in_one_tile_and_in_the_right_halos(tmp_path, monkeypatch):
    monkeypatch.setattr(point_stream, "CHUNK", 700)
    points = np.random.default_rng(0).uniform([-15, -15, 0], [25, 15, 3], (5000, 3))
    counts = fill_buckets(open_points(points), tmp_path, CONFIG)
    assert counts.total() == 5000
    for place in counts:
        corner = np.array([*place, 0.0]) * 10
        local = points - corner
        wanted = local[((local[:, :2] >= -1) & (local[:, :2] <= 11)).all(axis=1)]
        found = read_bucket(name_bucket(tmp_path, place))
        assert len(found) == len(wanted)
        assert np.allclose(np.sort(found, axis=0), np.sort(wanted, axis=0), atol=1e-5)


def test_far_coordinates_are_moved_by_whole_meters(tmp_path):
    points = np.random.default_rng(0).uniform(0, 5, (1000, 3)) + FAR
    stream = open_points(points)
    assert np.array_equal(stream.offset, np.round(np.median(points, axis=0)))
    near = open_points(points - FAR)
    assert not near.offset.any()


def test_a_mapped_file_gives_the_points_of_the_array(tmp_path, monkeypatch):
    monkeypatch.setattr(point_stream, "CHUNK", 100)
    points = np.random.default_rng(0).uniform(0, 5, (1050, 4)).astype(np.float32)
    points[7, 1] = np.nan
    np.save(tmp_path / "points.npy", points)
    chunks = list(open_points(tmp_path / "points.npy", meters=0.01).chunks())
    assert [len(chunk) for chunk in chunks] == [99, *[100] * 9, 50]
    assert np.allclose(np.concatenate(chunks), 0.01 * np.delete(points[:, :3], 7, axis=0))


def test_las_is_read_in_chunks(tmp_path, monkeypatch):
    laspy = pytest.importorskip("laspy", reason="laspy is not installed")
    monkeypatch.setattr(survey_files, "CHUNK", 100)
    points = np.random.default_rng(0).uniform(0, 50, (250, 3)) + FAR
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = points.min(axis=0), np.full(3, 1e-4)
    text = 'COMPD_CS["x",PROJCS["p",UNIT["foot",0.3048]],VERT_CS["h",UNIT["metre",1.0]]]'
    header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(text))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    classes = np.full(250, 2)
    classes[:5] = 7
    las.classification = classes
    las.write(tmp_path / "scan.las")
    stream = open_points(tmp_path / "scan.las")
    chunks = list(stream.chunks())
    assert [len(chunk) for chunk in chunks] == [95, 100, 50]
    factors = np.array([0.3048, 0.3048, 1.0])  # the file states feet, and meters of height
    assert np.allclose(np.concatenate(chunks), points[5:] * factors, atol=1e-3)
    assert np.allclose(stream.offset, np.round(points.mean(axis=0) * factors), atol=5)
    given = next(open_points(tmp_path / "scan.las", meters=1.0).chunks())
    assert np.allclose(given[:, :2], points[5:100, :2], atol=1e-3)


def test_without_laspy_the_extra_is_named(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "laspy", None)
    (tmp_path / "scan.laz").write_bytes(b"LASF")
    with pytest.raises(MissingExtraError, match=r"'formats'"):
        open_points(tmp_path / "scan.laz")


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((5, 2)), "shape"),
        (np.zeros(5), "shape"),
        (np.zeros((0, 3)), "there are no points"),
        (np.array([["a", "b", "c"]]), "must be numbers"),
    ],
)
def test_other_arrays_are_refused(tmp_path, array, message):
    with pytest.raises(ScanError, match=message):
        open_points(array)
    np.save(tmp_path / "points.npy", array)
    with pytest.raises(ScanError, match=message):
        open_points(tmp_path / "points.npy")


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(ScanError, match="no such file"):
        open_points(tmp_path / "nothing.npy")
    (tmp_path / "text.npy").write_text("hello")
    with pytest.raises(ScanError, match="not an array of numbers"):
        open_points(tmp_path / "text.npy")
