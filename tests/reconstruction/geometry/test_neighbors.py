"""Nearest neighbors that several threads find."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from reconstruction._src.geometry.neighbors import query_tree


@pytest.mark.parametrize("shape", [(0, 3), (1, 3), (500, 3), (40, 7, 3)])
@pytest.mark.parametrize("options", [{}, {"k": 5}, {"distance_upper_bound": 0.1}])
def test_it_is_what_one_thread_finds(shape, options):
    rng = np.random.default_rng(0)
    tree, places = cKDTree(rng.random((200, 3))), rng.random(shape)
    for found, wanted in zip(query_tree(tree, places, **options), tree.query(places, **options), strict=True):
        assert found.dtype == wanted.dtype
        np.testing.assert_array_equal(found, wanted)


def test_an_interruption_waits_for_the_threads():
    running, all_run = [], threading.Barrier(os.cpu_count() or 1)

    class Slow:
        def query(self, places):
            running.append(len(places))
            all_run.wait()
            time.sleep(0.1)  # until the last one has been noted
            if places[0, 0] == 0.0:  # the first part
                signal.raise_signal(signal.SIGINT)
            time.sleep(0.2)
            running.pop()
            return places[:, 0], places[:, 0].astype(int)

    with pytest.raises(KeyboardInterrupt):
        query_tree(Slow(), np.arange(3000.0).reshape(-1, 3))
    assert not running
