"""How densely a cloud samples its surface, place by place, and which samples belong to no surface.

An even cloud is recognized by a few probes and costs next to nothing. An uneven one (scan lines, a
scanner's near and far field, outliers) is measured sample by sample.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.neighbors import query_tree
from reconstruction._src.geometry.rows import Points, compute_lengths, sum_rows

_STRIDE = 4
"""Where neighbors lie on one line, every fourth sample is used instead, and so on: the spacing doubles."""
_MIN_SPACING = 1e-6  # Share of the median spacing that samples in one place have, so that none weighs nothing


_NUM_PROBES = 512  # Places at which a cloud is tested for evenness
_NEAR = 10  # Neighbors in the ball that measures the spacing of an even cloud, and the loneliness of a sample
_WIDE = 32  # Likewise in an uneven cloud, where fewer may lie on one scan line
_MAX_RATIO = 2.5
"""A cloud is even where the probes' spacings differ by less, 98th over 2nd percentile, and none is larger
than twice this times the median. Lower, and even clouds are measured sample by sample."""
_LINE_VARIANCE = 0.08  # Below this second variance a neighborhood is one scan line, not a surface
_MAX_LINE_SHARE = 0.05  # Share of the neighborhoods that may look like a line by chance
_GAP_RATIO = 1.5
"""In an uneven cloud the distance between samples varies with the direction; the largest is this many times
the mean."""
_EQUALITY = 0.75
"""Exponent of the area that a sample stands for in its weight: 0 puts the units where the samples are, 1
evenly on the surface. Sparse samples have noise of their own, so neither."""
_VOLUME_VARIANCE = 0.05  # Above this third variance a sparse neighborhood fills space and is no surface
_LONELINESS = 3.0  # An outlier is this many times farther from its neighbors than they are from theirs
_SPARSE_RATIO = 2.5  # Sparse is what is this many times farther from its neighbors than nine samples of ten
_PLANE_NEIGHBORS = 16  # Neighbors through which the plane is laid that an outlier stands off
_LOOSE_RATIO = 1.5
"""A neighbor this many times lonelier than the others may be an outlier itself and has no part in the
plane."""
_MIN_HEIGHT = 1.5  # An outlier stands off the plane by more than this many spacings of its neighbors
_HEIGHT_RATIO = 7.4
"""An outlier stands off it by more than this many times their median height, too; of a normal distribution 7.4
are five standard deviations."""
_NUM_PASSES = 2  # Searches for outliers, each among those left by the one before: outliers hide one another


class Density(NamedTuple):
    """The surroundings of every sample."""

    spacing: Float[np.ndarray, " N"]  # distance between samples, in the direction in which it is larger
    # what a sample counts, 1 on average: more where samples are sparse; 0 for outliers
    weights: Float[np.ndarray, " N"]


def measure_density(
    samples: Points, tree: cKDTree, rng: np.random.Generator, has_outliers: bool = True
) -> Density:
    """Measure the spacing of the samples and, unless there are none, find outliers."""
    num_samples = len(samples)
    near = min(_NEAR, num_samples - 1)
    probes = samples[rng.integers(0, num_samples, _NUM_PROBES)]
    distances, neighbors = tree.query(probes, k=near + 1)
    reach = distances[:, -1]
    low, typical, high = np.percentile(reach, [2, 50, 98])
    is_even = high < _MAX_RATIO * max(low, 1e-30) and reach.max() < 2 * _MAX_RATIO * typical
    line_share = _is_line(tree.data[neighbors]).mean()
    if is_even and line_share < _MAX_LINE_SHARE and not _has_thick_lines(samples, probes):
        spacing = typical * np.sqrt(np.pi / near)
        return Density(np.full(num_samples, spacing), np.ones(num_samples))
    return _measure_each(samples, has_outliers)


def _has_thick_lines(samples: Points, probes: Float[np.ndarray, "P 3"]) -> bool:
    """Return whether scan lines come out among fewer samples: noise larger than their spacing had hidden them."""
    for stride in (_STRIDE**2, _STRIDE**3):
        few = _draw_few(samples, stride)
        if len(few) < _NUM_PROBES:
            break
        _, neighbors = cKDTree(few).query(probes, k=_NEAR + 1)
        if _is_line(few[neighbors]).mean() >= _MAX_LINE_SHARE:
            return True
    return False


def _draw_few(samples: Points, stride: int) -> Float[np.ndarray, "F 3"]:
    """Return one of `stride` samples; drawn, as every sixteenth of a scan may lie on one line itself."""
    return samples[np.random.default_rng(stride).integers(0, len(samples), len(samples) // stride)]


def _measure_each(samples: Points, has_outliers: bool) -> Density:
    is_outlier = find_outliers(samples) if has_outliers else np.zeros(len(samples), dtype=bool)
    sound = samples[~is_outlier]
    tree = cKDTree(sound)
    wide = min(_WIDE, len(sound) - 1)
    distances, neighbors = query_tree(tree, sound, k=wide + 1)
    reach = _reach_beyond_lines(sound, distances[:, -1], neighbors)
    found = _GAP_RATIO * reach * np.sqrt(np.pi / wide)
    spacing = np.full(len(samples), np.median(found))
    spacing[~is_outlier] = np.maximum(found, _MIN_SPACING * np.median(found))
    weights = np.where(is_outlier, 0, (spacing**2) ** _EQUALITY)
    return Density(spacing, weights / weights.mean())


def _reach_beyond_lines(
    samples: Points, reach: Float[np.ndarray, " N"], neighbors: Int[np.ndarray, "N K"]
) -> Float[np.ndarray, " N"]:
    """Return how far it is to the farthest neighbor; where all lie on one scan line, among fewer samples."""
    is_lined = _is_line(samples[neighbors])
    is_found = np.zeros(len(samples), dtype=bool)
    reach, stride = reach.copy(), 1
    while len(samples) // (stride * _STRIDE) > neighbors.shape[1]:
        stride *= _STRIDE
        few = _draw_few(samples, stride)
        tree = cKDTree(few)
        if len(few) >= _NUM_PROBES:
            probes = samples[:: max(1, len(samples) // _NUM_PROBES)]
            around = tree.query(probes, k=neighbors.shape[1])[1]
            may_be_lined = _is_line(few[around]).mean() >= _MAX_LINE_SHARE
        else:
            may_be_lined = False
        left = np.flatnonzero(~is_found if may_be_lined else is_lined)
        if len(left) == 0:
            continue
        distances, around = query_tree(tree, samples[left], k=neighbors.shape[1])
        was_lined = is_lined[left]
        reach[left[was_lined]] = distances[was_lined, -1]
        is_lined[left] = _is_line(few[around])
        is_found[left] = was_lined & ~is_lined[left]
    return reach


def find_outliers(samples: Points) -> Bool[np.ndarray, " N"]:
    """Return which samples belong to no surface.

    They are lonelier than their neighbors, or stand off the plane through them, or are sparse and fill space.
    """
    is_sound = np.ones(len(samples), dtype=bool)
    for _ in range(_NUM_PASSES):
        kept = np.flatnonzero(is_sound)
        if len(kept) <= 2 * _PLANE_NEIGHBORS:
            break
        is_off = _find_off(samples[kept])
        if not is_off.any() or is_off.all():
            break
        is_sound[kept[is_off]] = False
    return ~is_sound


def _find_off(samples: Points) -> Bool[np.ndarray, " N"]:
    """Return which samples are outliers, each tested as if all others were none."""
    distances, neighbors = query_tree(cKDTree(samples), samples, k=_PLANE_NEIGHBORS + 1)
    near = min(_NEAR, _PLANE_NEIGHBORS)
    reach, others = distances[:, near], neighbors[:, 1:]
    is_off = reach > _LONELINESS * np.median(reach[neighbors[:, : near + 1]], axis=1)
    is_far = np.flatnonzero(reach > _SPARSE_RATIO * np.percentile(reach, 90))
    if len(is_far):
        is_off[is_far] |= find_spread(samples[neighbors[is_far]])[:, 2] > _VOLUME_VARIANCE
    spacing = np.median(distances[:, -1][others], axis=1) * np.sqrt(np.pi / _PLANE_NEIGHBORS)
    lateral = compute_lengths(samples - samples[others].mean(axis=1))
    # Only what is not in the middle of its neighbors can stand off their plane.
    todo = np.flatnonzero((lateral > _MIN_HEIGHT * spacing) & ~is_off)
    around = reach[others[todo]]
    share = (around <= _LOOSE_RATIO * np.median(around, axis=1)[:, None]).astype(samples.dtype)[..., None]
    center = (share * samples[others[todo]]).sum(axis=1) / share.sum(axis=1)
    offset = samples[others[todo]] - center[:, None]
    normal = np.linalg.eigh(np.swapaxes(share * offset, 1, 2) @ offset)[1][:, :, 0]
    scatter = np.median(np.abs(sum_rows(offset * normal[:, None])), axis=1)
    height = np.abs(sum_rows((samples[todo] - center) * normal))
    is_off[todo] |= height > np.maximum(_MIN_HEIGHT * spacing[todo], _HEIGHT_RATIO * scatter)
    return is_off


def _is_line(neighborhoods: Float[np.ndarray, "M K 3"]) -> Bool[np.ndarray, " M"]:
    """Return which neighborhoods are one scan line."""
    return find_spread(neighborhoods)[:, 1] < _LINE_VARIANCE


@np.errstate(divide="ignore", invalid="ignore")
def find_spread(neighborhoods: Float[np.ndarray, "M K 3"]) -> Float[np.ndarray, "M 3"]:
    """Return the variances of neighborhoods along their axes, largest first and relative to it; nan at one place."""
    offset = neighborhoods - neighborhoods.mean(axis=1, keepdims=True)
    variances = np.linalg.eigvalsh(np.swapaxes(offset, 1, 2) @ offset)[:, ::-1]
    return variances / variances[:, :1]
