"""Readings that pre-processing dropped."""

import numpy as np
import pytest

from reconstruction.errors import ScanError
from reconstruction.scans.cloud import Cloud
from reconstruction.scans.dropped import DroppedConfig, bin_dropped, find_dropped

LINE = np.stack([np.arange(0.0, 10.0, 0.05), np.zeros(200), np.zeros(200)], axis=1)


def test_readings_without_a_kept_point_near():
    kept = LINE[LINE[:, 0] < 5.0]
    dropped = find_dropped(LINE, kept)
    assert np.array_equal(dropped, LINE[:, 0] > kept[-1, 0] + 0.10)
    assert not find_dropped(LINE, LINE).any()
    assert find_dropped(LINE, LINE[:0]).all()
    assert len(find_dropped(LINE[:0], LINE)) == 0


def test_thinning_drops_nothing():
    assert not find_dropped(LINE, LINE[::20]).any()  # one point a meter
    assert find_dropped(LINE, LINE[::20], DroppedConfig(spacings=0.1)).mean() > 0.5


def test_bins_of_range():
    cloud = Cloud(LINE, viewpoints=np.zeros((1, 3)))
    bins = bin_dropped(cloud, LINE[:, 0] >= 8.0)
    assert [(each.low, each.high) for each in bins] == [(0, 2), (2, 4), (4, 8), (8, 16)]
    assert [each.dropped for each in bins] == [0.0, 0.0, 0.0, 1.0]
    assert sum(each.num_readings for each in bins) == 200
    assert bin_dropped(Cloud(LINE), np.zeros(200, dtype=bool)) == []


@pytest.mark.parametrize("name", ["reach", "spacings"])
def test_impossible_numbers_are_refused(name):
    with pytest.raises(ScanError, match=name):
        DroppedConfig(**{name: 0.0})
