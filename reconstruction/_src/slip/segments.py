"""Stretches of even friction along the way of a robot."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int


def find_segments(values: Float[np.ndarray, " D"], sigma: float, penalty: float) -> Int[np.ndarray, " D"]:
    """Return the number of the stretch that each value belongs to, from 0.

    Minimizes the sum of ``((value - mean of its stretch) / sigma)^2 + penalty`` per stretch, exactly, by dynamic
    programming.

    References:
        Jackson et al. (2005), An algorithm for optimal partitioning of data on an interval, IEEE Signal Proc. Letters
        12(2).
    """
    count = len(values)
    scaled = (values - values.mean() if count else values) / sigma
    sums, squares = (np.concatenate([[0.0], np.cumsum(scaled**power)]) for power in (1, 2))
    best, begin = np.zeros(count + 1), np.zeros(count + 1, dtype=np.int64)
    for end in range(1, count + 1):
        starts = np.arange(end)
        rest = squares[end] - squares[:end] - (sums[end] - sums[:end]) ** 2 / (end - starts)
        cost = best[:end] + rest + penalty
        begin[end] = int(np.argmin(cost))
        best[end] = cost[begin[end]]
    cuts, end = [], count
    while end > 0:
        end = int(begin[end])
        cuts.append(end)
    numbers = np.zeros(count, dtype=np.int64)
    numbers[[cut for cut in cuts if 0 < cut < count]] = 1
    return np.cumsum(numbers)
