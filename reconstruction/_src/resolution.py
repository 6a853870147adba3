"""How many units a scan needs: as many as its sparse parts can feed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.base.range_checks import check_all_positive
from reconstruction._src.networks.som.density import DensityConfig, measure_density


@dataclass(frozen=True)
class ResolutionConfig:
    """The resolution of a network whose number of units is not given.

    Attributes:
        even_samples: samples a unit in an even cloud: enough to average its noise.
        uneven_samples: samples a unit where an uneven cloud is sparse, at the percentile `sparse`. Fewer than 20: the
            error is that of the sparse parts, whose surface would be lost; half as many lose it between scan lines.
        sparse: so many percent of the samples are denser than where `uneven_samples` holds.
        fewest, most: limits of the number. 8,000 units (15,000 triangles) take 20 s of processor time for 100,000
            points.
        smallest_share: fewest samples a unit at all, for clouds too small for `fewest`.
        sample_size: larger clouds are judged by about so many of their points.
    """

    even_samples: float = 20.0
    uneven_samples: float = 6.0
    sparse: float = 90.0
    fewest: int = 500
    most: int = 8000
    smallest_share: float = 4.0
    sample_size: int = 100_000

    def __post_init__(self) -> None:
        check_all_positive(self)


_DEFAULT = ResolutionConfig()


def choose_units(points: Float[np.ndarray, "N 3"], config: ResolutionConfig = _DEFAULT) -> int:
    """Return how many units are enough for a cloud.

    Args:
        points: a checked cloud [m].
        config: samples a unit and limits.
    """
    stride = max(1, len(points) // config.sample_size)
    sample = points[::stride]
    density = measure_density(sample, cKDTree(sample), np.random.default_rng(0), DensityConfig())
    if np.ptp(density.spacing) == 0:
        wanted = len(points) / config.even_samples
    else:
        # A network shares its units out by these weights: where they are high, a unit has few samples.
        sparse = np.percentile(density.weights, config.sparse)
        wanted = stride * density.weights.sum() / (config.uneven_samples * sparse)
    most = min(config.most, int(len(np.unique(points, axis=0)) / config.smallest_share))
    return max(4, min(max(int(wanted), config.fewest), most))
