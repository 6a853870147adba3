"""Growing self-reconstruction map, batched."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from reconstruction.growth import grow
from reconstruction.progress import Progress, silent
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
    start = scaled[rng.choice(len(scaled), max(3, int(config.start_fraction * config.units)), replace=False)]
    weights = tiles.is_real.astype(np.float32)
    units = grow(
        tiles,
        weights,
        start,
        config.units,
        growth=config.growth,
        samples_per_unit=config.samples_per_unit,
        settle_passes=config.settle_passes,
        rng=rng,
    )
    winners = search_all(tiles, units, 3)[tiles.is_real]

    def has_samples(places):
        d, near = tiles.tree.query(places)
        dk, _ = tiles.tree.query(tiles.tree.data[near], k=9)
        return d <= 4 * dk[:, -1] / 1.6

    faces = learn_faces(units, winners, has_samples)
    used, faces = np.unique(faces, return_inverse=True)
    units, faces = units[used], faces.reshape(-1, 3)
    if config.fit_iterations:
        place = np.empty((len(scaled), 1), np.int32)
        where = np.full(config.units, -1, np.int32)
        where[used] = np.arange(len(used))
        first = where[winners[:, 0]]
        units = fit_surface(
            units,
            faces,
            tiles.samples[tiles.is_real],
            iterations=config.fit_iterations,
            winners=first if (first >= 0).all() else None,
        )
    return State(units * scale + center, faces)
