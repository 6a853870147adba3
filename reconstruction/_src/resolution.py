"""How many units a scan needs: as many as its sparse parts can feed."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.networks.som.density import measure_density

_EVEN_SAMPLES = 20.0  # Samples a unit in an even cloud: enough to average its noise
_WIDEST = 0.3
"""Units of an even cloud are no farther apart [m] where each still has `_UNEVEN_SAMPLES`: of a map of few points a
square meter things would be lost."""
_UNEVEN_SAMPLES = 6.0
"""Samples a unit where an uneven cloud is sparse, at the percentile `_SPARSE`. Fewer than 20: the error is that
of the sparse parts, whose surface would be lost; half as many lose it between scan lines."""
_SPARSE = 90.0  # So many percent of the samples are denser than where `_UNEVEN_SAMPLES` holds
_FEWEST, _MOST = 500, 8000
"""Limits of the number; 8,000 units (15,000 triangles) take 20 s of processor time for 100,000 points."""
_SMALLEST_SHARE = 4.0  # Fewest samples a unit at all, for clouds too small for `_FEWEST`
_SAMPLE_SIZE = 100_000  # Larger clouds are judged by about so many of their points


def choose_units(points: Float[np.ndarray, "N 3"]) -> int:
    """Return how many units are enough for a cloud.

    Args:
        points: a checked cloud [m].
    """
    stride = max(1, len(points) // _SAMPLE_SIZE)
    sample = points[::stride]
    density = measure_density(sample, cKDTree(sample), np.random.default_rng(0))
    if np.ptp(density.spacing) == 0:
        samples = _EVEN_SAMPLES, (_WIDEST / float(density.spacing[0])) ** 2
        wanted = len(points) / max(min(samples), _UNEVEN_SAMPLES)
    else:
        # A network shares its units out by these weights: where they are high, a unit has few samples.
        sparse = np.percentile(density.weights, _SPARSE)
        wanted = stride * density.weights.sum() / (_UNEVEN_SAMPLES * sparse)
    most = min(_MOST, int(len(np.unique(points, axis=0)) / _SMALLEST_SHARE))
    return max(4, min(max(int(wanted), _FEWEST), most))
