"""Mean, deviation, ratio and growth of costs that were measured alternately."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

RESAMPLES = 10_000
"""Bootstrap resamples; the ends of a 95 % interval then rest on the 250 lowest and highest ratios."""
Costs = Sequence[float] | Float[np.ndarray, " N"]


def summarize(values: Costs) -> dict[str, float]:
    """Return mean, standard deviation and median."""
    return {
        "mean": float(np.mean(values)),
        "deviation": float(np.std(values)),
        "median": float(np.median(values)),
    }


def find_ratio(costs: Costs, reference: Costs, seed: int = 0) -> dict[str, float]:
    """Return the ratio of two mean costs with its bootstrap interval of 95 %.

    Args:
        costs: cost of every run.
        reference: measured alternately in the same runs. A run is resampled with both its costs, so that a
            slowdown of the machine that affects both does not count.
        seed: seed of the resampling.

    References:
        Efron and Tibshirani (1993), An Introduction to the Bootstrap, section 13.3 (percentile interval).
    """
    pairs = np.stack([costs, reference], axis=1)
    rng = np.random.default_rng(seed)
    sums = np.stack([pairs[rng.integers(0, len(pairs), len(pairs))].sum(axis=0) for _ in range(RESAMPLES)])
    low, high = np.percentile(sums[:, 0] / sums[:, 1], (2.5, 97.5))
    mean = pairs.mean(axis=0)
    return {"ratio": float(mean[0] / mean[1]), "low": float(low), "high": float(high)}


def find_power(sizes: Costs | Int[np.ndarray, " N"], costs: Costs) -> float:
    """Return the exponent of a power law, costs over sizes: the slope of the logarithms, by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])
