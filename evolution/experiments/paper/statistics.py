"""Mean, deviation, ratio and growth of costs that were measured in turns."""

from collections.abc import Sequence

import numpy as np

RESAMPLES = 10_000


def summarise(values: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Return mean, standard deviation and median."""
    return {
        "mean": float(np.mean(values)),
        "deviation": float(np.std(values)),
        "median": float(np.median(values)),
    }


def find_ratio(
    costs: Sequence[float] | np.ndarray, reference: Sequence[float] | np.ndarray, seed: int = 0
) -> dict[str, float]:
    """Return the ratio of two mean costs with its bootstrap interval of 95 %.

    Args:
        costs: `[N]`, one a turn.
        reference: `[N]`, measured in the same turns; a turn is drawn with both its costs, so that what slowed
            down the machine for both does not count.
        seed: of the resampling.

    References:
        Efron and Tibshirani (1993), An Introduction to the Bootstrap, section 13.3 (percentile interval).
    """
    pairs = np.stack([costs, reference], axis=1)
    generator = np.random.default_rng(seed)
    sums = np.stack(
        [pairs[generator.integers(0, len(pairs), len(pairs))].sum(axis=0) for _ in range(RESAMPLES)]
    )
    low, high = np.percentile(sums[:, 0] / sums[:, 1], (2.5, 97.5))
    mean = pairs.mean(axis=0)
    return {"ratio": float(mean[0] / mean[1]), "low": float(low), "high": float(high)}


def find_power(sizes: Sequence[float] | np.ndarray, costs: Sequence[float] | np.ndarray) -> float:
    """Return the power of the sizes with which the costs grow: the slope of the logarithms, by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])
