"""Docking trials as on the hardware."""

import numpy as np
import pytest

from benchmarks.docking import run_docking_trials


@pytest.mark.slow
def test_docking_trials_lock_without_errors_and_repeat_by_the_seed():
    times = run_docking_trials(np.array([2, 3]), seed=1, noise=0.0)
    assert times.locked.all()
    assert times.recoveries.tolist() == [0, 0]
    assert times.seconds[0] > times.seconds[1]  # position 2 is farther away
    again = run_docking_trials(np.array([2, 3]), seed=1, noise=0.0)
    np.testing.assert_array_equal(times.seconds, again.seconds)
