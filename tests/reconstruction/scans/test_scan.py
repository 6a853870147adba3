"""Scan logs: their checks, their points, their file."""

import numpy as np
import pytest
from damage import flip_bits

from reconstruction._src.base.errors import ScanError
from reconstruction._src.geometry.pose import make_pose
from reconstruction._src.scans.scan import HorizontalScans, ScanLog, ScanTruth, load_scan_log


def make_log(**changes) -> ScanLog:
    rng = np.random.default_rng(0)
    ranges = rng.uniform(1, 4, (3, 5))
    ranges[0, 0] = np.nan
    scans = rng.uniform(1, 4, (3, 4))
    parts = {
        "horizontal": HorizontalScans(scans, np.arange(4.0), np.eye(4), np.zeros((3, 3)), np.zeros(3)),
        "truth": ScanTruth(make_pose(np.zeros(3), 0.0, 0.0), np.zeros((3, 5), bool)),
        "report": {"seed": 3.0},
        "box": [[-1, -1, 0], [1, 1, 2]],
    }
    poses = make_pose([0.0, 1.0, 2.0], 0.0, 0.1)
    return ScanLog(ranges, np.linspace(-1, 1, 5), poses, **(parts | changes))


def test_a_beam_ends_where_geometry_says():
    pose = make_pose(1.0, 2.0, np.pi / 2)[None]
    log = ScanLog([[2.0, 3.0]], [0.0, np.pi / 2], pose)
    np.testing.assert_allclose(log.points(), [[1, 4, 0], [-2, 2, 0]], atol=1e-12)


def test_no_return_is_nan_however_it_is_written():
    log = ScanLog([[1.0, np.inf, -1.0, 0.0, np.nan]], np.arange(5.0), np.eye(4)[None])
    assert log.is_valid.tolist() == [[True, False, False, False, False]]
    assert log.points().shape == (1, 3)


def test_what_is_saved_is_loaded(tmp_path):
    log = make_log()
    loaded = load_scan_log(log.save(tmp_path / "new" / "log.npz"))
    for name in ("ranges", "angles", "poses", "mount", "box"):
        np.testing.assert_array_equal(getattr(log, name), getattr(loaded, name))
    for name, part in (("horizontal", log.horizontal), ("truth", log.truth)):
        for key, value in vars(part).items():
            np.testing.assert_array_equal(value, getattr(getattr(loaded, name), key))
    assert loaded.report == log.report
    assert len(list((tmp_path / "new").iterdir())) == 1


def test_a_bare_log_is_saved_and_loaded(tmp_path):
    log = ScanLog(np.ones((2, 3)), np.zeros(3), np.tile(np.eye(4), (2, 1, 1)))
    loaded = load_scan_log(log.save(tmp_path / "log.npz"))
    assert (loaded.horizontal, loaded.truth, loaded.box, loaded.slip) == (None,) * 4
    assert repr(loaded) == "ScanLog(2 scans of 3 beams)"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ((np.ones(3), np.zeros(3), np.eye(4)[None]), "2 axes"),
        ((np.ones((1, 3)), np.zeros(2), np.eye(4)[None]), "3 beams"),
        ((np.ones((2, 3)), np.zeros(3), np.eye(4)[None]), r"\(2, 4, 4\)"),
        ((np.ones((1, 3)), [0, np.nan, 1], np.eye(4)[None]), "finite"),
        ((np.ones((1, 3)), np.zeros(3), 2 * np.eye(4)[None]), "rigid"),
        ((np.array([["a"] * 3]), np.zeros(3), np.eye(4)[None]), "numbers"),
    ],
)
def test_a_log_that_contradicts_itself_is_refused(arguments, reason):
    with pytest.raises(ScanError, match=reason):
        ScanLog(*arguments)


def test_boxes_and_colors_are_checked():
    for change in ({"box": [[1, 1, 1], [0, 0, 0]]}, {"colors": np.zeros((3, 5, 3))}):
        with pytest.raises(ScanError, match=next(iter(change))):
            make_log(**change)


def save_npz(path, **arrays):
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"points": np.ones((9, 3))}, "not a scan log"),
        ({"report_names": np.array([["a"]])}, "not a scan log"),
    ],
)
def test_other_npz_files_are_refused(tmp_path, arrays, reason):
    path = save_npz(tmp_path / "a.npz", **arrays)
    with pytest.raises(ScanError, match=reason) as error:
        load_scan_log(path)
    assert str(path) in str(error.value)


def test_a_flipped_bit_in_a_log_gives_the_same_or_the_error(tmp_path):
    log = make_log()
    path = log.save(tmp_path / "a.npz")
    refused = []
    for damaged in flip_bits(path.read_bytes(), 300):
        path.write_bytes(damaged)
        try:
            loaded = load_scan_log(path)
        except ScanError as error:
            refused.append(str(error))
            continue
        for name in ("ranges", "angles", "poses", "mount", "box"):
            np.testing.assert_array_equal(getattr(log, name), getattr(loaded, name))
        assert loaded.report == log.report
    assert len(refused) > 100
    assert all(str(path) in message for message in refused)


def test_a_log_with_missing_parts_is_refused(tmp_path):
    path = make_log().save(tmp_path / "a.npz")
    with np.load(path) as file:
        arrays = dict(file)
    del arrays["horizontal.angles"]
    with pytest.raises(ScanError, match="angles"):
        load_scan_log(save_npz(tmp_path / "b.npz", **arrays))


def test_absent_logs_and_other_suffixes_are_refused(tmp_path):
    with pytest.raises(ScanError, match="absent"):
        load_scan_log(tmp_path / "absent.npz")
    with pytest.raises(ScanError, match=r"\.npz"):
        make_log().save(tmp_path / "a.csv")
