"""How densely a cloud samples its surface, place by place, and which samples belong to no surface.

An even cloud is recognised by a few probes and costs next to nothing. An uneven one (scan lines, a
scanner's near and far field, outliers) is studied sample by sample.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.rows import find_lengths, sum_rows

NUM_PROBES = 512
_NEAR = 10
_WIDE = 32
_UNEVEN = 2.5
"""An even cloud's probes differ by less: 98th over 2nd percentile of the distance to the tenth neighbour."""
_LINEAR = 0.08
"""Below this ratio of variances a neighbourhood is one scan line, not a surface."""
_MAX_LINED = 0.05
"""Share of neighbourhoods that may look like a line by chance."""
_GAPS = 1.5
"""In an uneven cloud the distance between samples varies with the direction: it is up to so many times the mean."""
_STRIDE = 4
"""Where neighbours lie on one line, every fourth sample is looked at instead."""
_EQUALITY = 0.75
"""Exponent of the area a sample stands for in its weight: 0 puts the units where the samples are, 1 evenly on
the surface. Sparse samples have noise of their own, so neither."""
_THICK = 0.05
"""Above this ratio of variances a sparse neighbourhood fills space, it is no surface."""
_LONELY = 3.0
"""An outlier is so many times farther from its neighbours than they are from theirs."""
_FAR = 2.5
"""Sparse is what is so many times farther from its neighbours than nine samples of ten."""
_AROUND = 16
_LOOSE = 1.5
"""A neighbour so many times lonelier than the others may be an outlier itself and has no part in the plane."""
_ALOFT = 1.5
"""An outlier stands off the plane of its neighbours by so many of their spacings"""
_SCATTER = 7.4
"""and so many times farther than their median: five standard deviations."""
_PASSES = 2
"""Outliers hide one another: what is left is looked at once more."""


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
    low, typical, high = np.percentile(reach, [2, 50, 98])
    is_line = _find_spread(tree.data[neighbors])[:, 1] < _LINEAR
    spacing = typical * np.sqrt(np.pi / near)
    is_even = high < _UNEVEN * max(low, 1e-30) and reach.max() < 2 * _UNEVEN * typical
    if is_even and is_line.mean() < _MAX_LINED and not _has_thick_lines(samples, probes):
        return Density(np.full(num_samples, spacing), np.ones(num_samples))
    return _study_all(samples)


def _has_thick_lines(samples: np.ndarray, probes: np.ndarray) -> bool:
    """Tell whether scan lines come out among fewer samples: noise larger than their spacing had hidden them."""
    for stride in (_STRIDE**2, _STRIDE**3):
        few = _draw_few(samples, stride)
        if len(few) < NUM_PROBES:
            break
        _, neighbors = cKDTree(few).query(probes, k=_NEAR + 1)
        if (_find_spread(few[neighbors])[:, 1] < _LINEAR).mean() >= _MAX_LINED:
            return True
    return False


def _draw_few(samples: np.ndarray, stride: int) -> np.ndarray:
    """Return one sample of `stride`; drawn, as every sixteenth of a scan may lie on one line itself."""
    return samples[np.random.default_rng(stride).integers(0, len(samples), len(samples) // stride)]


def _study_all(samples: np.ndarray) -> Density:
    is_outlier = find_outliers(samples)
    sound = samples[~is_outlier]
    tree = cKDTree(sound)
    wide = min(_WIDE, len(sound) - 1)
    distances, neighbors = tree.query(sound, k=wide + 1, workers=-1)
    reach = _reach_beyond_lines(sound, distances[:, -1], neighbors)
    found = _GAPS * reach * np.sqrt(np.pi / wide)
    spacing = np.full(len(samples), np.median(found))
    spacing[~is_outlier] = np.maximum(found, 1e-6 * np.median(found))
    weights = np.where(is_outlier, 0, (spacing**2) ** _EQUALITY)
    return Density(spacing, weights / weights.mean())


def _reach_beyond_lines(samples: np.ndarray, reach: np.ndarray, neighbors: np.ndarray) -> np.ndarray:
    """Return `[N]` how far it is to the farthest neighbour; where all lie on one scan line, among fewer samples.

    Args:
        samples: `[N, 3]`.
        reach: `[N]` distance to the farthest neighbour.
        neighbors: `[N, K]` indices.
    """
    is_lined = _find_spread(samples[neighbors])[:, 1] < _LINEAR
    is_found = np.zeros(len(samples), dtype=bool)
    reach, stride = reach.copy(), 1
    while len(samples) // (stride * _STRIDE) > neighbors.shape[1]:
        stride *= _STRIDE
        few = _draw_few(samples, stride)
        tree = cKDTree(few)
        if len(few) >= NUM_PROBES:
            probes = samples[:: max(1, len(samples) // NUM_PROBES)]
            around = tree.query(probes, k=neighbors.shape[1])[1]
            may_be_lined = (_find_spread(few[around])[:, 1] < _LINEAR).mean() >= _MAX_LINED
        else:
            may_be_lined = False
        chosen = np.flatnonzero(~is_found if may_be_lined else is_lined)
        if len(chosen) == 0:
            continue
        distances, around = tree.query(samples[chosen], k=neighbors.shape[1], workers=-1)
        was_lined = is_lined[chosen]
        reach[chosen[was_lined]] = distances[was_lined, -1]
        is_lined[chosen] = _find_spread(few[around])[:, 1] < _LINEAR
        is_found[chosen] = was_lined & ~is_lined[chosen]
    return reach


def find_outliers(samples: np.ndarray) -> np.ndarray:
    """Return which samples belong to no surface, `[N]`.

    They are lonelier than their neighbours, or stand off the plane through them, or are sparse and fill space.

    Args:
        samples: `[N, 3]`.
    """
    is_sound = np.ones(len(samples), dtype=bool)
    for _ in range(_PASSES):
        kept = np.flatnonzero(is_sound)
        if len(kept) <= 2 * _AROUND:
            break
        is_off = _find_off(samples[kept])
        if not is_off.any() or is_off.all():
            break
        is_sound[kept[is_off]] = False
    return ~is_sound


def _find_off(samples: np.ndarray) -> np.ndarray:
    """Return which samples `[N]` are outliers, all others taken for sound."""
    distances, neighbors = cKDTree(samples).query(samples, k=_AROUND + 1, workers=-1)
    reach, others = distances[:, _NEAR], neighbors[:, 1:]
    is_off = reach > _LONELY * np.median(reach[neighbors[:, : _NEAR + 1]], axis=1)
    is_far = np.flatnonzero(reach > _FAR * np.percentile(reach, 90))
    if len(is_far):
        is_off[is_far] |= _find_spread(samples[neighbors[is_far]])[:, 2] > _THICK
    spacing = np.median(distances[:, -1][others], axis=1) * np.sqrt(np.pi / _AROUND)
    lateral = find_lengths(samples - samples[others].mean(axis=1))
    # Only what is not in the middle of its neighbours can stand off their plane.
    todo = np.flatnonzero((lateral > _ALOFT * spacing) & ~is_off)
    around = reach[others[todo]]
    share = (around <= _LOOSE * np.median(around, axis=1)[:, None]).astype(samples.dtype)[..., None]
    center = (share * samples[others[todo]]).sum(axis=1) / share.sum(axis=1)
    offset = samples[others[todo]] - center[:, None]
    normal = np.linalg.eigh(np.swapaxes(share * offset, 1, 2) @ offset)[1][:, :, 0]
    scatter = np.median(np.abs(sum_rows(offset * normal[:, None])), axis=1)
    height = np.abs(sum_rows((samples[todo] - center) * normal))
    is_off[todo] |= height > np.maximum(_ALOFT * spacing[todo], _SCATTER * scatter)
    return is_off


def _find_spread(neighborhoods: np.ndarray) -> np.ndarray:
    """Return the variances of neighbourhoods `[M, K, 3]` along their axes, largest first and 1: `[M, 3]`."""
    offset = neighborhoods - neighborhoods.mean(axis=1, keepdims=True)
    variances = np.linalg.eigvalsh(np.swapaxes(offset, 1, 2) @ offset)[:, ::-1]
    return variances / np.maximum(variances[:, :1], 1e-300)
