"""How densely a cloud samples its surface, place by place, and which samples belong to no surface.

An even cloud is recognized by a few probes and costs next to nothing. An uneven one (scan lines, a
scanner's near and far field, outliers) is measured sample by sample.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.base.range_checks import check_all_positive
from reconstruction._src.geometry.rows import find_lengths, sum_rows

_STRIDE = 4
"""Where neighbors lie on one line, every fourth sample is used instead, and so on: the spacing doubles."""
_MIN_SPACING = 1e-6
"""Share of the median spacing that samples in one place have, so that none weighs nothing."""


@dataclass(frozen=True)
class DensityConfig:
    """How the spacing of samples is measured and outliers are found. A neighborhood's variances are relative to
    its largest.

    Attributes:
        num_probes: places at which a cloud is tested for evenness.
        near: neighbors in the ball that measures the spacing of an even cloud, and the loneliness of a sample.
        wide: likewise in an uneven cloud, where fewer may lie on one scan line.
        max_ratio: a cloud is even where the probes' spacings differ by less, 98th over 2nd percentile, and none is
            larger than twice this times the median. Lower, and even clouds are measured sample by sample.
        line_variance: below this second variance a neighborhood is one scan line, not a surface.
        max_line_share: share of the neighborhoods that may look like a line by chance.
        gap_ratio: in an uneven cloud the distance between samples varies with the direction; the largest is this
            many times the mean.
        equality: exponent of the area that a sample stands for in its weight: 0 puts the units where the samples are,
            1 evenly on the surface. Sparse samples have noise of their own, so neither.
        volume_variance: above this third variance a sparse neighborhood fills space and is no surface.
        loneliness: an outlier is this many times farther from its neighbors than they are from theirs.
        sparse_ratio: sparse is what is this many times farther from its neighbors than nine samples of ten.
        plane_neighbors: neighbors through which the plane is laid that an outlier stands off.
        loose_ratio: a neighbor this many times lonelier than the others may be an outlier itself and has no part in
            the plane.
        min_height: an outlier stands off the plane by more than this many spacings of its neighbors,
        height_ratio: and by more than this many times their median height; of a normal distribution 7.4 are five
            standard deviations.
        num_passes: searches for outliers, each among those left by the one before: outliers hide one another.
    """

    num_probes: int = 512
    near: int = 10
    wide: int = 32
    max_ratio: float = 2.5
    line_variance: float = 0.08
    max_line_share: float = 0.05
    gap_ratio: float = 1.5
    equality: float = 0.75
    volume_variance: float = 0.05
    loneliness: float = 3.0
    sparse_ratio: float = 2.5
    plane_neighbors: int = 16
    loose_ratio: float = 1.5
    min_height: float = 1.5
    height_ratio: float = 7.4
    num_passes: int = 2

    def __post_init__(self) -> None:
        check_all_positive(self, may_be_zero=("equality", "num_passes"))


class Density(NamedTuple):
    """The surroundings of every sample.

    Attributes:
        spacing: distance between samples, in the direction in which it is larger.
        weights: what a sample counts, 1 on average: more where samples are sparse; 0 for outliers.
    """

    spacing: Float[np.ndarray, " N"]
    weights: Float[np.ndarray, " N"]


def measure_density(
    samples: Float[np.ndarray, "N 3"], tree: cKDTree, rng: np.random.Generator, config: DensityConfig
) -> Density:
    """Measure the spacing of the samples and find outliers."""
    num_samples = len(samples)
    near = min(config.near, num_samples - 1)
    probes = samples[rng.integers(0, num_samples, config.num_probes)]
    distances, neighbors = tree.query(probes, k=near + 1)
    reach = distances[:, -1]
    low, typical, high = np.percentile(reach, [2, 50, 98])
    is_even = high < config.max_ratio * max(low, 1e-30) and reach.max() < 2 * config.max_ratio * typical
    line_share = _is_line(tree.data[neighbors], config).mean()
    if is_even and line_share < config.max_line_share and not _has_thick_lines(samples, probes, config):
        spacing = typical * np.sqrt(np.pi / near)
        return Density(np.full(num_samples, spacing), np.ones(num_samples))
    return _measure_each(samples, config)


def _has_thick_lines(
    samples: Float[np.ndarray, "N 3"], probes: Float[np.ndarray, "P 3"], config: DensityConfig
) -> bool:
    """Return whether scan lines come out among fewer samples: noise larger than their spacing had hidden them."""
    for stride in (_STRIDE**2, _STRIDE**3):
        few = _draw_few(samples, stride)
        if len(few) < config.num_probes:
            break
        _, neighbors = cKDTree(few).query(probes, k=config.near + 1)
        if _is_line(few[neighbors], config).mean() >= config.max_line_share:
            return True
    return False


def _draw_few(samples: Float[np.ndarray, "N 3"], stride: int) -> Float[np.ndarray, "F 3"]:
    """Return one of `stride` samples; drawn, as every sixteenth of a scan may lie on one line itself."""
    return samples[np.random.default_rng(stride).integers(0, len(samples), len(samples) // stride)]


def _measure_each(samples: Float[np.ndarray, "N 3"], config: DensityConfig) -> Density:
    is_outlier = find_outliers(samples, config)
    sound = samples[~is_outlier]
    tree = cKDTree(sound)
    wide = min(config.wide, len(sound) - 1)
    distances, neighbors = tree.query(sound, k=wide + 1, workers=-1)
    reach = _reach_beyond_lines(sound, distances[:, -1], neighbors, config)
    found = config.gap_ratio * reach * np.sqrt(np.pi / wide)
    spacing = np.full(len(samples), np.median(found))
    spacing[~is_outlier] = np.maximum(found, _MIN_SPACING * np.median(found))
    weights = np.where(is_outlier, 0, (spacing**2) ** config.equality)
    return Density(spacing, weights / weights.mean())


def _reach_beyond_lines(
    samples: Float[np.ndarray, "N 3"],
    reach: Float[np.ndarray, " N"],
    neighbors: Int[np.ndarray, "N K"],
    config: DensityConfig,
) -> Float[np.ndarray, " N"]:
    """Return how far it is to the farthest neighbor; where all lie on one scan line, among fewer samples."""
    is_lined = _is_line(samples[neighbors], config)
    is_found = np.zeros(len(samples), dtype=bool)
    reach, stride = reach.copy(), 1
    while len(samples) // (stride * _STRIDE) > neighbors.shape[1]:
        stride *= _STRIDE
        few = _draw_few(samples, stride)
        tree = cKDTree(few)
        if len(few) >= config.num_probes:
            probes = samples[:: max(1, len(samples) // config.num_probes)]
            around = tree.query(probes, k=neighbors.shape[1])[1]
            may_be_lined = _is_line(few[around], config).mean() >= config.max_line_share
        else:
            may_be_lined = False
        left = np.flatnonzero(~is_found if may_be_lined else is_lined)
        if len(left) == 0:
            continue
        distances, around = tree.query(samples[left], k=neighbors.shape[1], workers=-1)
        was_lined = is_lined[left]
        reach[left[was_lined]] = distances[was_lined, -1]
        is_lined[left] = _is_line(few[around], config)
        is_found[left] = was_lined & ~is_lined[left]
    return reach


def find_outliers(samples: Float[np.ndarray, "N 3"], config: DensityConfig) -> Bool[np.ndarray, " N"]:
    """Return which samples belong to no surface.

    They are lonelier than their neighbors, or stand off the plane through them, or are sparse and fill space.
    """
    is_sound = np.ones(len(samples), dtype=bool)
    for _ in range(config.num_passes):
        kept = np.flatnonzero(is_sound)
        if len(kept) <= 2 * config.plane_neighbors:
            break
        is_off = _find_off(samples[kept], config)
        if not is_off.any() or is_off.all():
            break
        is_sound[kept[is_off]] = False
    return ~is_sound


def _find_off(samples: Float[np.ndarray, "N 3"], config: DensityConfig) -> Bool[np.ndarray, " N"]:
    """Return which samples are outliers, each tested as if all others were none."""
    distances, neighbors = cKDTree(samples).query(samples, k=config.plane_neighbors + 1, workers=-1)
    near = min(config.near, config.plane_neighbors)
    reach, others = distances[:, near], neighbors[:, 1:]
    is_off = reach > config.loneliness * np.median(reach[neighbors[:, : near + 1]], axis=1)
    is_far = np.flatnonzero(reach > config.sparse_ratio * np.percentile(reach, 90))
    if len(is_far):
        is_off[is_far] |= _find_spread(samples[neighbors[is_far]])[:, 2] > config.volume_variance
    spacing = np.median(distances[:, -1][others], axis=1) * np.sqrt(np.pi / config.plane_neighbors)
    lateral = find_lengths(samples - samples[others].mean(axis=1))
    # Only what is not in the middle of its neighbors can stand off their plane.
    todo = np.flatnonzero((lateral > config.min_height * spacing) & ~is_off)
    around = reach[others[todo]]
    share = (around <= config.loose_ratio * np.median(around, axis=1)[:, None]).astype(samples.dtype)[
        ..., None
    ]
    center = (share * samples[others[todo]]).sum(axis=1) / share.sum(axis=1)
    offset = samples[others[todo]] - center[:, None]
    normal = np.linalg.eigh(np.swapaxes(share * offset, 1, 2) @ offset)[1][:, :, 0]
    scatter = np.median(np.abs(sum_rows(offset * normal[:, None])), axis=1)
    height = np.abs(sum_rows((samples[todo] - center) * normal))
    is_off[todo] |= height > np.maximum(config.min_height * spacing[todo], config.height_ratio * scatter)
    return is_off


def _is_line(neighborhoods: Float[np.ndarray, "M K 3"], config: DensityConfig) -> Bool[np.ndarray, " M"]:
    """Return which neighborhoods are one scan line."""
    return _find_spread(neighborhoods)[:, 1] < config.line_variance


def _find_spread(neighborhoods: Float[np.ndarray, "M K 3"]) -> Float[np.ndarray, "M 3"]:
    """Return the variances of neighborhoods along their axes, largest first and relative to it."""
    offset = neighborhoods - neighborhoods.mean(axis=1, keepdims=True)
    variances = np.linalg.eigvalsh(np.swapaxes(offset, 1, 2) @ offset)[:, ::-1]
    return variances / np.maximum(variances[:, :1], 1e-300)
