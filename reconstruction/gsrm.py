"""Growing self-reconstruction map, batched."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from reconstruction.density import study_density
from reconstruction.growth import grow, make_level
from reconstruction.progress import Progress, silent
from reconstruction.support import make_support
from reconstruction.surface_fit import fit_surface
from reconstruction.topology import learn_faces
from reconstruction.winners import make_tiles, search_all


@dataclass(frozen=True)
class GSRMConfig:
    """How the map grows."""

    units: int = 2200
    growth: float = 1.5
    samples_per_unit: int = 8
    settle_passes: int = 5
    start_fraction: float = 0.12
    fit_iterations: int = 3


class State(NamedTuple):
    """A map: `units [U, 3]` and `faces [F, 3]`."""

    units: np.ndarray
    faces: np.ndarray


def train(points, config=GSRMConfig(), seed=0, progress: Progress = silent) -> State:
    """Grow."""
    rng = np.random.default_rng(seed)
    points = np.asarray(points, dtype=np.float64)
    center = points.mean(axis=0)
    scale = np.sqrt(((points - center) ** 2).sum(axis=1).mean())
    scaled = ((points - center) / scale).astype(np.float32)
    tiles = make_tiles(scaled)
    density = study_density(scaled, tiles.tree, rng)
    level = make_level(tiles, density)
    usable = np.flatnonzero(density.weights)
    num_start = max(3, int(config.start_fraction * config.units))
    start = scaled[rng.choice(usable, num_start, replace=False)]
    units = grow(
        level,
        start,
        config.units,
        growth=config.growth,
        samples_per_unit=config.samples_per_unit,
        settle_passes=config.settle_passes,
        rng=rng,
    )
    is_used = level.weights > 0
    winners = search_all(tiles, units, 3)[is_used]

    faces = learn_faces(units, winners, make_support(level))
    used, faces = np.unique(faces, return_inverse=True)
    units, faces = units[used], faces.reshape(-1, 3)
    if config.fit_iterations:
        place = np.full(config.units, -1, dtype=np.int32)
        place[used] = np.arange(len(used))
        first = place[winners[:, 0]]
        is_covered = first >= 0
        units = fit_surface(
            units,
            faces,
            tiles.samples[is_used][is_covered],
            iterations=config.fit_iterations,
            winners=first[is_covered],
            weights=level.weights[is_used][is_covered],
        )
    return State(units * scale + center, faces)
