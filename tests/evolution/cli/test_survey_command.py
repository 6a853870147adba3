"""The options of `symbrion survey`: waypoints, scanner, and what is refused."""

import numpy as np
import pytest

import reconstruction as rc
from evolution._src.cli.command import UsageError
from evolution._src.cli.commands.survey import Survey, read_path
from evolution._src.cli.main import run

PLACES = [[-1.0, 1.6], [0.2, 2.8]]


def test_waypoints_come_from_words_and_lines():
    for text in ("-1,1.6 0.2,2.8", "-1,1.6\n0.2,2.8\n"):
        np.testing.assert_array_equal(read_path(text), PLACES)


@pytest.mark.parametrize("path", ["", "1,2", "a,b c,d", "1,2,3 4,5,6", "1,1 1,1", "nan,1 2,2", "absent.csv"])
def test_waypoints_that_lead_nowhere_are_refused(path):
    with pytest.raises(UsageError, match="--path"):
        read_path(path)


@pytest.mark.parametrize("option", [{"speed": 0.0}, {"noise": -0.1}, {"beams": 1}])
def test_impossible_robots_are_refused(option):
    with pytest.raises(UsageError, match="--"):
        Survey(**option)


def test_a_short_drive_is_logged(tmp_path):
    out = tmp_path / "log.npz"
    words = ["survey", "truth", "--path=-1,1.6 0,2.6", "--speed", "0.5", "--beams", "181"]
    assert run([*words, "--out", str(out), "--quiet"]) == 0
    assert rc.load_scan_log(out).ranges.shape[1] == 181
