"""What pre-processing dropped, and where."""

import numpy as np

from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.preprocess import find_dropped, measure_dropped, preprocess


def make_walls(seed: int = 0) -> np.ndarray:
    """Return a wall at 3 m with 10,000 readings and one at 12 m with 600."""
    rng = np.random.default_rng(seed)
    near = np.c_[np.full(10_000, 3.0), rng.uniform(-1.5, 1.5, (10_000, 2))]
    far = np.c_[np.full(600, 12.0), rng.uniform(-1.5, 1.5, (600, 2))]
    return np.concatenate([near, far])


def test_a_dropped_wall_is_told_with_its_range():
    points = make_walls()
    dropped = measure_dropped(Cloud(points, viewpoints=np.zeros((1, 3))), points[:10_000])
    assert dropped.share == 600 / 10_600
    assert [(part.near, part.far) for part in dropped.by_range] == [(2.0, 4.0), (8.0, 16.0)]
    assert [part.share for part in dropped.by_range] == [0.0, 1.0]
    assert str(dropped) == "5.7 % of the readings; at 8 to 16 m 100.0 %"


def test_without_a_viewpoint_only_the_share_is_known():
    points = make_walls()
    dropped = measure_dropped(Cloud(points), points[:10_000])
    assert dropped.by_range == ()
    assert str(dropped) == "5.7 % of the readings"
    assert measure_dropped(Cloud(points[:0]), points).share == 0.0


def test_thinned_and_moved_readings_are_not_lost():
    points = make_walls()
    is_dropped, chosen = find_dropped(points, points[::3] + 0.003)
    assert is_dropped.mean() < 0.01
    assert len(chosen) == len(points)
    assert find_dropped(points, points[:0])[0].all()
    assert not find_dropped(points[:1], points)[0].any()


def test_a_far_wall_survives_pre_processing_and_strays_do_not():
    points = make_walls()
    rng = np.random.default_rng(1)
    strays = np.c_[rng.uniform(0.5, 2.5, 100), rng.uniform(-1.5, 1.5, (100, 2))]
    cloud = Cloud(np.concatenate([points, strays]), viewpoints=np.zeros((1, 3)))
    kept = preprocess(cloud)
    assert isinstance(kept, Cloud)
    assert kept.seen_from is not None
    far = kept.points[:, 0] > 11
    assert far.sum() >= 0.97 * 600
    assert (kept.points[:, 0] < 2.9).sum() <= 10
    np.testing.assert_array_equal(preprocess(cloud.points), kept.points)
