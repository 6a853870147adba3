"""How densely a cloud samples its surface, place by place, and which samples belong to no surface.

An even cloud is recognised by a few probes and costs next to nothing. An uneven one (scan lines, a
scanner's near and far field, outliers) is studied sample by sample.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

NUM_PROBES = 512
_NEAR = 10
_WIDE = 32
_UNEVEN = 3.0
"""An even cloud's probes differ by less: 95th over 5th percentile of the distance to the tenth neighbour."""
_LINEAR = 0.08
"""Below this ratio of variances a neighbourhood is one scan line, not a surface."""
_EQUALITY = 0.75
"""Exponent of the area a sample stands for in its weight: 0 puts the units where the samples are, 1 evenly on
the surface. Sparse samples have noise of their own, so neither."""
_THICK = 0.05
"""Above this ratio of variances a sparse neighbourhood fills space, it is no surface."""
_LONELY = 3.0
"""An outlier is so many times farther from its neighbours than they are from theirs."""


class Density(NamedTuple):
    """What is known of every sample's surroundings.

    Attributes:
        spacing: `[N]` distance between samples, in the direction in which it is larger.
        weights: `[N]` what a sample counts, 1 on average: more where samples are sparse; 0 for outliers.
    """

    spacing: np.ndarray
    weights: np.ndarray


def study_density(samples: np.ndarray, tree: cKDTree, rng: np.random.Generator) -> Density:
    """Measure the spacing of the samples and find outliers.

    Args:
        samples: `[N, 3]`.
        tree: of the samples, or of the samples and a few repetitions.
        rng: draws the probes.
    """
    num_samples = len(samples)
    near = min(_NEAR, num_samples - 1)
    probes = samples[rng.integers(0, num_samples, NUM_PROBES)]
    distances, neighbors = tree.query(probes, k=near + 1)
    reach = distances[:, -1]
    low, typical, high = np.percentile(reach, [5, 50, 95])
    is_line = _find_spread(tree.data[neighbors])[:, 1] < _LINEAR
    spacing = typical * np.sqrt(np.pi / near)
    if high < _UNEVEN * max(low, 1e-30) and reach.max() < 2 * _UNEVEN * typical and is_line.mean() < 0.05:
        return Density(np.full(num_samples, spacing), np.ones(num_samples))
    return _study_all(samples)


def _study_all(samples: np.ndarray) -> Density:
    tree = cKDTree(samples)
    wide = min(_WIDE, len(samples) - 1)
    near = min(_NEAR, wide)
    distances, neighbors = tree.query(samples, k=wide + 1, workers=-1)
    reach = distances[:, near]
    is_outlier = reach > _LONELY * np.median(reach[neighbors], axis=1)
    is_far = np.flatnonzero(reach > (1 + _LONELY) * np.percentile(reach, 90))
    if len(is_far):
        is_outlier[is_far] |= _find_spread(samples[neighbors[is_far]])[:, 2] > _THICK
    spacing = np.zeros(len(samples))
    for k in sorted({near, min(20, wide), wide}):
        # The fewest neighbours that span a surface; where none do, the most.
        todo = np.flatnonzero(spacing == 0)
        is_surface = _find_spread(samples[neighbors[todo, : k + 1]])[:, 1] >= _LINEAR
        chosen = todo[is_surface | (k == wide)]
        spacing[chosen] = distances[chosen, k] * np.sqrt(np.pi / k)
    spacing = np.maximum(spacing, 1e-6 * np.median(spacing))
    weights = np.where(is_outlier, 0, (spacing**2) ** _EQUALITY)
    return Density(spacing, weights / weights.mean())


def _find_spread(neighborhoods: np.ndarray) -> np.ndarray:
    """Return the variances of neighbourhoods `[M, K, 3]` along their axes, largest first and 1: `[M, 3]`."""
    offset = neighborhoods - neighborhoods.mean(axis=1, keepdims=True)
    variances = np.linalg.eigvalsh(np.einsum("mki,mkj->mij", offset, offset))[:, ::-1]
    return variances / np.maximum(variances[:, :1], 1e-300)
