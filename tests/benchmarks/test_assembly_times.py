"""Medians of assembly times, with intervals."""

import numpy as np

from benchmarks.material.swarm_weights import LONGEST, describe_times


def test_the_interval_holds_the_median_and_late_ones_are_counted() -> None:
    found = describe_times(np.array([100.0, 200.0, 300.0, LONGEST, 250.0]))
    assert found["median"] == 250.0
    low, high = found["interval"]
    assert low <= 250.0 <= high
    assert found["late"] == 1
    assert describe_times(np.full(5, 7.0))["interval"] == [7.0, 7.0]
