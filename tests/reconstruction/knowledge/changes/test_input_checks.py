"""Origins that are none are refused, and new readings of another unit."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.knowledge.changes.input_checks import check_free_rays, check_origins, check_scale


def test_origins_that_are_none_are_refused():
    assert check_origins([1, 2, 3], 5).shape == (5, 3)
    for wrong, reason in (
        (np.zeros((4, 3)), r"\[5, 3\]"),
        ([0.0, np.nan, 0.0], "NaN"),
        (["a", "b", "c"], "real numbers"),
    ):
        with pytest.raises(ReconstructionError, match=reason):
            check_origins(wrong, 5)


def test_free_rays_that_are_none_are_refused():
    assert check_free_rays(np.zeros((4, 2, 3))).shape == (4, 2, 3)
    for wrong, reason in (
        (np.zeros((4, 3)), r"\[K, 2, 3\]"),
        (np.full((1, 2, 3), np.inf), "infinity"),
        ([["a"]], "real numbers"),
    ):
        with pytest.raises(ReconstructionError, match=reason):
            check_free_rays(wrong)


def test_another_unit_is_noticed():
    points = np.random.default_rng(2).uniform(-1, 1, (100, 3))
    check_scale(points + np.array([3, 0, 0]), points)
    with pytest.raises(ReconstructionError, match="in meters"):
        check_scale(1000 * points, points)
